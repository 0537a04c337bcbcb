"""Lengths and cosines at any scale, in any type: what NumPy's wide floats give."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor
from torch.testing import assert_close

import torchvsa
from torchvsa import FHRR, HRR, MAP, CleanUp
from torchvsa._numerics import inner_products, norms, paired_products

bounded = settings(deadline=None, derandomize=True, max_examples=60)
SCALES = [1e-44, 1e-30, 1e-20, 1.0, 1e18, 1e20, 1e37]


def drawn(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def reference(x: Tensor) -> np.ndarray:
    """In float64, brought to the largest element 1 first."""
    wide = x.detach().numpy().astype(np.complex128 if x.is_complex() else np.float64)
    return wide / np.abs(wide).max(-1, keepdims=True)


def cosine(a: Tensor, b: Tensor) -> np.ndarray:
    x, y = reference(a), reference(b)
    return np.real(x * y.conj()).sum(-1) / np.sqrt((np.abs(x) ** 2).sum(-1) * (np.abs(y) ** 2).sum(-1))


@pytest.mark.parametrize("other", SCALES)
@pytest.mark.parametrize("scale", SCALES)
def test_cosines_do_not_depend_on_scale(scale: float, other: float) -> None:
    a, b = drawn(5, 100) * scale, drawn(5, 100, seed=1) * other
    for vsa, x, y in ((MAP(100), a, b), (FHRR(100), torch.complex(a, a.flip(0)), torch.complex(b, b))):
        assert_close(vsa.similarity(x, y).double(), torch.from_numpy(cosine(x, y)), atol=2e-6, rtol=0)
        assert_close(vsa.similarity(x, x), torch.ones(5))
        assert_close(torch.vmap(vsa.similarity)(x, y), vsa.similarity(x, y))
        assert_close(CleanUp(y)(x).similarity, vsa.similarity(x[:, None], y).amax(1), atol=2e-6, rtol=0)


@pytest.mark.parametrize("scale", [1e-300, 1e300])
def test_neither_do_those_of_wide_floats(scale: float) -> None:
    x = drawn(5, 100).double() * scale
    assert_close(MAP(100, dtype=torch.float64).similarity(x, x), torch.ones(5))
    assert CleanUp(x)(x).index.tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("scale", SCALES)
def test_lengths_are_right_at_any_scale(scale: float) -> None:
    x = drawn(5, 100) * scale
    exact = np.sqrt((reference(x) ** 2).sum(-1)) * x.double().abs().amax(-1).numpy()
    assert_close(norms(x), torch.from_numpy(exact), rtol=1e-6, atol=0)
    assert_close(HRR(100).normalize(x).norm(dim=-1), torch.ones(5))


@pytest.mark.parametrize("make", [MAP, FHRR])
@pytest.mark.parametrize("scale", [2.0**-100, 1.0, 2.0**100])
def test_scaled_programs_have_scaled_unbound_norms(make: Callable[[int], torchvsa.VSA], scale: float) -> None:
    vsa = make(100)
    program, keys = vsa.superpose(vsa.random(7)), vsa.random(4)
    assert torch.equal(vsa.unbound_norm(program * scale, keys), vsa.unbound_norm(program, keys) * scale)


def test_powers_of_two_change_no_bit_of_a_cosine() -> None:
    a, b = drawn(50, 100), drawn(50, 100, seed=1)
    plain, memory = MAP(100).similarity(a, b), CleanUp(b)(a)
    graph = torch.compile(MAP(100).similarity, fullgraph=True, backend="aot_eager")
    assert torch.equal(graph(a, b), plain)
    for scale in (2.0**-90, 2.0**90):
        assert torch.equal(MAP(100).similarity(a * scale, b / scale), plain)
        scaled = CleanUp(b / scale)(a * scale)
        assert torch.equal(scaled.index, memory.index)
        assert_close(scaled.similarity, memory.similarity, rtol=1e-6, atol=0)
    torch.compiler.reset()


@pytest.mark.parametrize("scale", [1e-25, 1.0, 1e25])
def test_cosines_have_gradients_at_any_scale(scale: float) -> None:
    x, y = (drawn(3, 20) * scale).requires_grad_(), drawn(3, 20, seed=1)
    (gradient,) = torch.autograd.grad(MAP(20).similarity(x, y).sum(), x)
    wide = (x.detach().double() / scale).requires_grad_()
    (expected,) = torch.autograd.grad(torch.cosine_similarity(wide, y.double(), -1).sum(), wide)
    assert_close(gradient.double() * scale, expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_half_precision_is_compared_in_single(dtype: torch.dtype) -> None:
    items, queries = (drawn(4, 70_000) * 10).to(dtype), (drawn(6, 70_000, seed=1) * 10).to(dtype)
    queries[:4] += items
    single = CleanUp(items.float())(queries.float())
    for memory, asked in ((CleanUp(items), queries), (CleanUp(items.float()).to(dtype), queries),
                          (CleanUp(items), queries.float()), (CleanUp(items.float()), queries)):  # fmt: skip
        assert all(torch.equal(a, b) for a, b in zip(memory(asked), single, strict=True))
    assert single.index[:4].tolist() == [0, 1, 2, 3]
    assert torch.equal(MAP(70_000).similarity(items, items), torch.ones(4))
    assert torch.equal(norms(items), norms(items.float()))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_no_silent_guess(bad: float) -> None:
    queries = torch.eye(3)[[0, 1, 1, 2]]
    queries[2, 0] = bad
    for count in (1, 3):
        match = CleanUp(torch.eye(3)[:count])(queries)
        assert match.similarity.isnan().tolist() == match.margin.isnan().tolist() == [False, False, True, False]
    assert MAP(3).similarity(queries, queries).isnan().tolist() == [False, False, True, False]
    with pytest.raises(ValueError, match="items must be finite; item 2 holds NaN or infinity"):
        CleanUp(queries)(torch.eye(3))


def overwritten(memory: CleanUp, items: Tensor) -> None:
    memory.items.copy_(items)


def by_data(memory: CleanUp, items: Tensor) -> None:
    memory.items.data = items


def by_numpy(memory: CleanUp, items: Tensor) -> None:
    memory.items.numpy()[:] = items.numpy()


def assigned(memory: CleanUp, items: Tensor) -> None:
    memory.items = items


@pytest.mark.parametrize("dtype", [torch.int8, torch.int32, torch.float32, torch.float64])
@pytest.mark.parametrize("write", [overwritten, by_data, by_numpy, assigned])
def test_items_may_be_written_in_any_way(write: Callable[[CleanUp, Tensor], None], dtype: torch.dtype) -> None:
    items, queries = ((10 * drawn(20, 50, seed=seed)).to(dtype) for seed in (0, 1))
    memory = CleanUp((2 * items).roll(1, 0).clone())
    memory(queries)
    write(memory, items.clone())
    for answer, fresh in zip(memory(queries), CleanUp(items)(queries), strict=True):
        assert torch.equal(answer, fresh)


@pytest.mark.parametrize(
    ("rows", "count", "d"), [(1, 1, 131_040), (20, 20, 131_041), (3, 2, 131_073), (20, 5, 270_000)]
)
def test_full_range_int8_is_exact_in_any_dimension(rows: int, count: int, d: int) -> None:
    generator = torch.Generator().manual_seed(d)
    a, b = (torch.randint(-128, 128, (size, d), generator=generator, dtype=torch.int8) for size in (rows, count))
    a[0], b[0] = -128, -128
    wide_a, wide_b = a.numpy().astype(np.int64), b.numpy().astype(np.int64)
    assert (inner_products(a, b).numpy() == wide_a @ wide_b.T).all()
    assert paired_products(a[0], b[0]).item() == 2**14 * d
    assert_close(norms(a).numpy(), np.sqrt((wide_a**2).sum(-1)), rtol=4e-16, atol=0)
    match = CleanUp(b)(a)
    assert match.index[0] == 0
    assert match.similarity[0] == 1


@bounded
@given(data=st.data(), kinds=st.tuples(*[st.sampled_from([torch.int8, torch.int32, torch.int64, torch.float32])] * 2))
def test_wide_integers_are_right_to_the_rounding_of_float64(
    data: st.DataObject, kinds: tuple[torch.dtype, ...]
) -> None:
    d, vectors, exact = data.draw(st.integers(1, 9)), [], []
    for kind in kinds:
        info = torch.iinfo(kind) if not kind.is_floating_point else torch.iinfo(torch.int8)
        numbers = data.draw(st.lists(st.integers(info.min, info.max), min_size=d, max_size=d))
        vectors.append(torch.tensor(numbers, dtype=kind))
        exact.append(numbers)
    a, b = vectors
    product = sum(x * y for x, y in zip(*exact, strict=True))
    size = sum(abs(x * y) for x, y in zip(*exact, strict=True))
    for answer in (paired_products(a, b), inner_products(a, b[None])[0]):
        assert abs(int(answer.double()) - product) <= 4 * d * 2.0**-53 * size
    length = math.sqrt(sum(x * x for x in exact[0]))
    assert norms(a).item() == pytest.approx(length, rel=1e-15 if not a.is_floating_point() else 1e-6)
    if size < 2**53:
        assert int(paired_products(a, b)) == product
