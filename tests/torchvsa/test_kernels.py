"""The fast paths: each equals the plain line beside it, wherever that can be said."""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.func import jacrev, jvp, vmap
from torch.testing import assert_close

from torchvsa import MAP
from torchvsa._kernels.integer_products import integer_products
from torchvsa._kernels.look_up import gather_reduce
from torchvsa._kernels.rotation import roll_rows
from torchvsa._numerics import inner_products

TYPES = [torch.int8, torch.bool, torch.int32, torch.float32, torch.float64, torch.complex64]


def drawn(*shape: int, dtype: torch.dtype = torch.float64, seed: int = 0) -> Tensor:
    numbers = torch.randint(-3, 4, shape, generator=torch.Generator().manual_seed(seed))
    return numbers.to(dtype)


def turned(rows: Tensor, starts: Tensor) -> Tensor:
    """By NumPy, one row after the other."""
    pairs = zip(rows.numpy(), starts.tolist(), strict=True)
    return torch.from_numpy(np.stack([np.roll(row, -start) for row, start in pairs]))


def whole(function: Callable[..., Any]) -> Callable[..., Any]:
    return torch.compile(function, fullgraph=True, backend="aot_eager")


@pytest.mark.parametrize("dtype", TYPES, ids=str)
@pytest.mark.parametrize("count", [0, 1, 2, 11])
def test_rows_are_rolled(count: int, dtype: torch.dtype) -> None:
    rows, starts = drawn(count, 7, dtype=dtype), drawn(count, dtype=torch.int64, seed=1) + 3
    expected = turned(rows, starts) if count else rows
    assert torch.equal(roll_rows(rows, starts), expected)
    assert torch.equal(whole(roll_rows)(rows, starts), expected)
    torch.compiler.reset()


def test_many_rows_are_rolled_in_blocks() -> None:
    vsa = MAP(20_000, dtype=torch.int8)
    rows = vsa.random(300, generator=torch.Generator().manual_seed(0))
    shifts = torch.arange(300) * 67
    assert torch.equal(vsa.permute(rows, shifts), turned(rows, -shifts))


@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of its own parts
def test_rotations_are_mapped_and_differentiated() -> None:
    rows, starts = drawn(3, 4, 5), torch.arange(12).view(3, 4) % 5
    expected = torch.stack([turned(x, first) for x, first in zip(rows, starts, strict=True)])
    assert torch.equal(vmap(roll_rows)(rows, starts), expected)
    assert torch.equal(vmap(roll_rows, (None, 0))(rows[0], starts)[2], turned(rows[0], starts[2]))
    value, slope = cast(Any, jvp(lambda x: roll_rows(x, starts[0]), (rows[0],), (rows[1],)))
    assert torch.equal(value, turned(rows[0], starts[0]))
    assert torch.equal(slope, turned(rows[1], starts[0]))
    leaf = rows[0].clone().requires_grad_()
    (roll_rows(leaf, starts[0]) * rows[1]).sum().backward()
    assert leaf.grad is not None
    assert torch.equal(leaf.grad, turned(rows[1], -starts[0]))


STEPS: list[tuple[Any, bool, Callable[[np.ndarray], np.ndarray], torch.dtype]] = [
    *((Tensor.add_, True, lambda rows: rows.sum(0).clip(-1, 1), dtype) for dtype in (torch.int8, torch.float64)),
    *((Tensor.mul_, False, lambda rows: rows.prod(0), dtype) for dtype in (torch.int8, torch.float32)),
    (Tensor.bitwise_xor_, False, np.bitwise_xor.reduce, torch.bool),
]


@pytest.mark.parametrize(("step", "clip", "expected", "dtype"), STEPS)
@pytest.mark.parametrize("lists", [1, 2, 4])
def test_entries_are_put_together(lists: int, step: Any, clip: bool, expected: Any, dtype: torch.dtype) -> None:
    # More bytes than a block holds.
    table, indices = drawn(lists, 4, 200_000, dtype=dtype), drawn(30, lists, dtype=torch.int64, seed=1) % 4
    numbers = [table.numpy()[range(lists), row] for row in indices.numpy()]
    wanted = torch.from_numpy(np.stack([expected(rows) for rows in numbers])).to(dtype)
    assert torch.equal(gather_reduce(table, indices, step, clip), wanted)
    assert gather_reduce(table, indices[:0], step, clip).shape == (0, 200_000)
    small = table[..., :9].contiguous()
    assert torch.equal(vmap(lambda rows: gather_reduce(small, rows[None], step, clip)[0])(indices), wanted[:, :9])
    assert torch.equal(whole(gather_reduce)(small, indices, step, clip), wanted[:, :9])
    torch.compiler.reset()


def test_looking_up_is_differentiated() -> None:
    table, indices = drawn(3, 4, 5).requires_grad_(), drawn(6, 3, dtype=torch.int64, seed=1) % 4
    assert torch.autograd.gradcheck(lambda x: gather_reduce(x, indices, Tensor.mul_), (table,))
    assert torch.autograd.gradcheck(lambda x: gather_reduce(x, indices, Tensor.add_), (table,))


def test_products_of_floats_are_as_near_as_those_of_pytorch() -> None:
    a, b = (torch.randn(64, 1000, generator=torch.Generator().manual_seed(seed)) for seed in (0, 1))
    assert_close(inner_products(a, b).double(), a.double() @ b.double().T, atol=1e-4, rtol=0)
    strided = torch.randn(1000, 64, generator=torch.Generator().manual_seed(2)).T
    assert_close(inner_products(strided, b[::2]).double(), strided.double() @ b[::2].double().T, atol=1e-4, rtol=0)


@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of its own parts
def test_products_are_mapped_and_differentiated() -> None:
    a, b = drawn(3, 20, 5, dtype=torch.float32), drawn(3, 4, 5, dtype=torch.float32, seed=1)
    assert torch.equal(vmap(inner_products)(a, b), a @ b.mT)
    assert torch.equal(vmap(inner_products, (0, None))(a, b[0]), a @ b[0].T)
    assert torch.equal(vmap(inner_products, (None, 0))(a[0], b), a[0] @ b.mT)
    value, slope = cast(Any, jvp(inner_products, (a[0], b[0]), (a[1], b[1])))
    assert torch.equal(value, a[0] @ b[0].T)
    assert torch.equal(slope, a[1] @ b[0].T + a[0] @ b[1].T)
    assert torch.equal(jacrev(lambda x: inner_products(a[0], x).sum())(b[0]), a[0].sum(0).expand(4, 5))
    leaf = a[0].clone().requires_grad_()
    inner_products(leaf, b[0]).sum().backward()
    assert leaf.grad is not None
    assert torch.equal(leaf.grad, b[0].sum(0).expand(20, 5))


@pytest.mark.parametrize("units", [True, False])
@pytest.mark.parametrize("dim", [1, 2, 333, 1024, 2047])
@pytest.mark.parametrize("items", [1, 2, 3, 4, 15, 16, 17])
@pytest.mark.parametrize("rows", [1, 16, 17, 40])
def test_integer_products_are_exact_with_and_without_integer_units(
    rows: int, items: int, dim: int, units: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("torchvsa._kernels.integer_products._HAS_UNITS", units)
    generator = torch.Generator().manual_seed(rows)
    a, b = (torch.randint(-128, 128, (count, dim), generator=generator, dtype=torch.int8) for count in (rows, items))
    assert (integer_products(a, b).numpy() == a.numpy().astype(np.int64) @ b.numpy().astype(np.int64).T).all()
    assert integer_products(a, b).dtype == torch.int32


@pytest.mark.parametrize("units", [True, False])
def test_the_largest_integer_products_are_exact(units: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torchvsa._kernels.integer_products._HAS_UNITS", units)
    for dim in (131_040, 131_041, 200_001):
        x = torch.full((2, dim), -128, dtype=torch.int8)
        assert (integer_products(x, x) == dim * 2**14).all()
