"""Inner products and norms against NumPy's wide integers and floats."""

from itertools import product

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from torch import Tensor
from torch.testing import assert_close

from torchvsa._kernels.integer_products import by_whole_tiles
from torchvsa._numerics import as_bipolar, inner_products, norms, paired_products, safe_divide, safe_sqrt

bounded = settings(deadline=None, derandomize=True, max_examples=60)
INTEGERS = [torch.int8, torch.int16, torch.int32, torch.int64]


def wide(x: Tensor) -> np.ndarray:
    return as_bipolar(x).to(torch.int64).numpy()


@bounded
@given(data=st.data(), a=st.sampled_from(INTEGERS), b=st.sampled_from(INTEGERS), d=st.integers(1, 70))
def test_integer_products_are_exact(data: st.DataObject, a: torch.dtype, b: torch.dtype, d: int) -> None:
    codes = st.integers(-128, 127)
    x = torch.from_numpy(data.draw(hnp.arrays(np.int64, (2, 3, d), elements=codes))).to(a)
    y = torch.from_numpy(data.draw(hnp.arrays(np.int64, (5, d), elements=codes))).to(b)
    assert (inner_products(x, y).numpy() == wide(x) @ wide(y).T).all()
    assert (paired_products(x, y[:3]).numpy() == (wide(x) * wide(y[:3])).sum(-1)).all()
    # PyTorch's vectorised root may err in the last bit.
    assert_close(norms(x).numpy(), np.sqrt((wide(x) ** 2).sum(-1)), rtol=4e-16, atol=0)


@pytest.mark.parametrize("device", ["cpu", "cuda"])
def test_whole_tiles_change_no_product(device: str) -> None:
    if device == "cuda" and not torch.cuda.is_available():
        pytest.skip("there is no CUDA device")
    generator = torch.Generator().manual_seed(0)
    for rows, count, d in product((0, 1, 17, 64), (1, 3, 32, 50), (1, 7, 64, 1000)):
        x, y = (torch.randint(-128, 128, (size, d), generator=generator, dtype=torch.int8) for size in (rows, count))
        answer = by_whole_tiles(x.to(device), y.to(device))
        assert answer.dtype == torch.int32
        assert (answer.cpu().numpy() == wide(x) @ wide(y).T).all()


@pytest.mark.parametrize("shape", [(3, 40), (40,), (0, 40), (2, 2, 40)])
def test_bits_count_as_votes(shape: tuple[int, ...]) -> None:
    generator = torch.Generator().manual_seed(0)
    x = torch.randint(2, shape, generator=generator, dtype=torch.uint8).bool()
    items = torch.randint(2, (6, 40), generator=generator, dtype=torch.uint8).bool()
    assert as_bipolar(torch.tensor([False, True])).tolist() == [1, -1]
    assert (inner_products(x, items).numpy() == wide(x) @ wide(items).T).all()
    votes = torch.randint(-9, 9, shape, generator=generator, dtype=torch.int32)
    assert (inner_products(votes, items).numpy() == wide(votes) @ wide(items).T).all()


def test_large_integers_do_not_overflow() -> None:
    codes = torch.full((1, 100_000), -128, dtype=torch.int8)
    votes = torch.full((1, 4000), 2_000_000_000, dtype=torch.int32)
    assert inner_products(codes, codes).item() == 128**2 * 100_000
    assert paired_products(codes, codes).item() == 128**2 * 100_000
    assert inner_products(votes, codes[:, :4000]).item() == -128 * 2_000_000_000 * 4000
    assert paired_products(votes, codes[:, :4000]).item() == -128 * 2_000_000_000 * 4000


def test_strides_do_not_matter() -> None:
    x = torch.randint(-1, 2, (40, 6), generator=torch.Generator().manual_seed(0), dtype=torch.int8).T
    assert (inner_products(x, x[::2]).numpy() == wide(x) @ wide(x[::2]).T).all()


@pytest.mark.parametrize("conjugated", [False, True])
@pytest.mark.parametrize("dtype", [torch.complex64, torch.complex128])
def test_complex_products_are_hermitian_and_real(dtype: torch.dtype, conjugated: bool) -> None:
    x, y = (torch.randn(4, 30, generator=torch.Generator().manual_seed(s), dtype=dtype) for s in (0, 1))
    x = x.conj() if conjugated else x
    y = y.to(torch.complex64)
    expected = torch.from_numpy(np.real(x.resolve_conj().numpy() @ y.numpy().conj().T))
    assert_close(inner_products(x, y).double(), expected.double(), atol=1e-4, rtol=0)
    assert_close(paired_products(x, y).double(), expected.diagonal().double(), atol=1e-4, rtol=0)


def test_division_by_no_length_is_zero() -> None:
    lengths = torch.tensor([2.0, 0.0], requires_grad=True)
    quotient = safe_divide(torch.tensor([3.0, 4.0]), lengths)
    assert quotient.tolist() == [1.5, 0]
    (gradient,) = torch.autograd.grad(quotient.sum(), lengths)
    assert gradient.tolist() == [-0.75, 0]


def test_the_root_has_a_gradient_at_zero() -> None:
    squares = torch.tensor([4.0, 0.0], requires_grad=True)
    assert safe_sqrt(squares).tolist() == [2, 0]
    (gradient,) = torch.autograd.grad(safe_sqrt(squares).sum(), squares)
    assert gradient.tolist() == [0.25, 0]
