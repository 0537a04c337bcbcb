"""The operators of our own: what they say is what the line of PyTorch says, wherever that can be said."""

from collections.abc import Callable
from functools import partial
from typing import Any, cast

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.func import jacrev, jvp, vmap
from torch.testing import assert_close

from torchvsa.exact import dots
from torchvsa.operators import common, look_up, looked_up, rotated, rotation

TYPES = [torch.int8, torch.bool, torch.int32, torch.float32, torch.float64, torch.complex64]


def drawn(*shape: int, dtype: torch.dtype = torch.float64, seed: int = 0) -> Tensor:
    numbers = torch.randint(-3, 4, shape, generator=torch.Generator().manual_seed(seed))
    return numbers.to(dtype)


def turned(rows: Tensor, starts: Tensor) -> Tensor:
    """By NumPy, one row after the other."""
    pairs = zip(rows.numpy(), starts.tolist(), strict=True)
    return torch.from_numpy(np.stack([np.roll(row, -start) for row, start in pairs]))


def in_blocks_of(cache: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows of as many bytes at a time, by operators even if the rows are few."""
    monkeypatch.setattr(common, "CACHE_BYTES", cache)
    monkeypatch.setattr(rotation, "MANY", 1)
    monkeypatch.setattr(look_up, "MANY", 1)


def whole(function: Callable[..., Any]) -> Callable[..., Any]:
    return torch.compile(function, fullgraph=True, backend="aot_eager")


@pytest.mark.parametrize("dtype", TYPES, ids=str)
@pytest.mark.parametrize("count", [1, 2, 4, 5, 11])
def test_rows_are_rotated_wherever_blocks_end(count: int, dtype: torch.dtype, monkeypatch: pytest.MonkeyPatch) -> None:
    rows, starts = drawn(count, 7, dtype=dtype), drawn(count, dtype=torch.int64, seed=1) + 3
    expected = turned(rows, starts)
    assert torch.equal(rotated(rows, starts), expected)
    assert torch.equal(whole(rotated)(rows, starts), expected)
    in_blocks_of(2 * 2 * 7 * rows.element_size(), monkeypatch)
    assert torch.equal(rotated(rows, starts), expected)
    torch.compiler.reset()


@pytest.mark.parametrize("cache", [2**20, 2 * 2 * 7, 1])
@pytest.mark.parametrize("count", [1, 4, 5])
def test_rows_are_superposed_before_they_are_rotated(count: int, cache: int, monkeypatch: pytest.MonkeyPatch) -> None:
    in_blocks_of(cache, monkeypatch)
    codes = torch.randint(-1, 2, (3, count + 1, 7), generator=torch.Generator().manual_seed(count), dtype=torch.int8)
    rows, added = codes[:, 1:], codes[:, 0]
    starts = torch.arange(3 * count).view(3, count) % 7
    expected = torch.stack(
        [turned((x + y).clamp(-1, 1), first) for x, y, first in zip(rows, added, starts, strict=True)]
    )
    assert torch.equal(rotated(rows[0], starts[0], added[0]), expected[0])
    assert torch.equal(whole(rotated)(rows[0], starts[0], added[0]), expected[0])
    assert torch.equal(vmap(rotated)(rows, starts, added), expected)
    alone = [rotated(x, starts[0], added[0]) for x in rows]
    assert torch.equal(vmap(rotated, (0, None, None))(rows, starts[0], added[0]), torch.stack(alone))
    torch.compiler.reset()


def test_no_row_is_rotated() -> None:
    assert rotated(torch.empty(0, 7), torch.empty(0, dtype=torch.int64)).shape == (0, 7)


@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of its own parts
@pytest.mark.parametrize("cache", [2**20, 1])
def test_rotations_are_mapped_and_differentiated(cache: int, monkeypatch: pytest.MonkeyPatch) -> None:
    in_blocks_of(cache, monkeypatch)
    rows, starts = drawn(3, 4, 5), torch.arange(12).view(3, 4) % 5
    expected = torch.stack([turned(some, first) for some, first in zip(rows, starts, strict=True)])
    assert torch.equal(vmap(rotated)(rows, starts), expected)
    assert torch.equal(
        vmap(rotated, (1, None))(rows.transpose(0, 1), starts[0]), vmap(rotated, (0, None))(rows, starts[0])
    )
    assert torch.equal(vmap(rotated, (None, 0))(rows[0], starts)[2], turned(rows[0], starts[2]))
    value, slope = cast(Any, jvp(lambda x: rotated(x, starts[0]), (rows[0],), (rows[1],)))
    assert torch.equal(value, turned(rows[0], starts[0]))
    assert torch.equal(slope, turned(rows[1], starts[0]))
    leaf = rows[0].clone().requires_grad_()
    (rotated(leaf, starts[0]) * rows[1]).sum().backward()
    assert leaf.grad is not None
    assert torch.equal(leaf.grad, turned(rows[1], (-starts[0]) % 5))


def together(table: Tensor, places: Tensor, how: str) -> Tensor:
    """By NumPy, one row after the other."""
    entries = [table.numpy()[range(len(table)), row] for row in places.numpy()]
    join: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "clipped sum": lambda some: some.sum(0).clip(-1, 1),
        "product": lambda some: some.prod(0),
        "exclusive or": np.bitwise_xor.reduce,
    }
    return torch.from_numpy(np.stack([join[how](some) for some in entries]))


@pytest.mark.parametrize(
    ("how", "dtype"),
    [
        *((how, dtype) for how in ("clipped sum", "product") for dtype in (torch.int8, torch.float32, torch.float64)),
        ("exclusive or", torch.bool),
    ],
    ids=str,
)
@pytest.mark.parametrize("cache", [2**20, 2 * 2 * 7, 1])
@pytest.mark.parametrize("lists", [1, 2, 4])
def test_entries_are_put_together_wherever_blocks_end(
    lists: int, cache: int, how: Any, dtype: torch.dtype, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_blocks_of(cache, monkeypatch)
    table, places = drawn(lists, 4, 7, dtype=dtype), drawn(11, lists, dtype=torch.int64, seed=1) % 4
    expected = together(table, places, how).to(dtype)
    assert expected.unique().numel() > 1
    assert torch.equal(looked_up(table, places, how), expected)
    assert torch.equal(whole(looked_up)(table, places, how), expected)
    assert torch.equal(looked_up(table, places[:1], how), expected[:1])
    assert looked_up(table, places[:0], how).shape == (0, 7)
    torch.compiler.reset()


@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of its own parts
@pytest.mark.parametrize("cache", [2**20, 1])
@pytest.mark.parametrize("how", ["clipped sum", "product"])
def test_looking_up_is_mapped_and_differentiated(how: Any, cache: int, monkeypatch: pytest.MonkeyPatch) -> None:
    in_blocks_of(cache, monkeypatch)
    tables, places = drawn(3, 3, 4, 5), drawn(3, 6, 3, dtype=torch.int64, seed=1) % 4
    expected = [together(table, some, how) for table, some in zip(tables, places, strict=True)]
    put_together = partial(looked_up, how=how)
    assert torch.equal(vmap(put_together)(tables, places), torch.stack(expected))
    assert torch.equal(vmap(put_together, (1, 0))(tables.transpose(0, 1), places), torch.stack(expected))
    alone = together(tables[0], places[2], how)
    assert torch.equal(vmap(put_together, (None, 0))(tables[0], places)[2], alone)
    assert torch.equal(vmap(put_together, (None, 1))(tables[0], places.transpose(0, 1))[2], alone)
    assert torch.equal(vmap(put_together, (0, None))(tables, places[2])[0], alone)
    small = tables[0] / 10  # nothing is clipped
    seen = [small[i, column] for i, column in enumerate(places[0].T)]
    around = torch.stack([torch.ones_like(seen[0])] * 3 if how == "clipped sum" else
                         [seen[1] * seen[2], seen[0] * seen[2], seen[0] * seen[1]])  # fmt: skip
    slopes = sum(one * tables[1][i, column] for i, (one, column) in enumerate(zip(around, places[0].T, strict=True)))
    value, slope = cast(Any, jvp(lambda x: put_together(x, places[0]), (small,), (tables[1],)))
    assert_close(value, together(small, places[0], how))
    assert_close(slope, slopes)
    leaf = small.clone().requires_grad_()
    put_together(leaf, places[0]).sum().backward()
    asked = torch.zeros_like(leaf)
    for i, column in enumerate(places[0].T):
        asked[i].index_add_(0, column, around[i])
    assert leaf.grad is not None
    assert_close(leaf.grad, asked)


def test_products_of_floats_are_as_near_as_those_of_pytorch() -> None:
    a, b = (torch.randn(64, 1000, generator=torch.Generator().manual_seed(seed)) for seed in (0, 1))
    assert_close(dots(a, b).double(), a.double() @ b.double().T, atol=1e-4, rtol=0)
    strided = torch.randn(1000, 64, generator=torch.Generator().manual_seed(2)).T
    assert_close(dots(strided, b[::2]).double(), strided.double() @ b[::2].double().T, atol=1e-4, rtol=0)


@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of its own parts
def test_products_are_mapped_and_differentiated() -> None:
    a, b = drawn(3, 20, 5, dtype=torch.float32), drawn(3, 4, 5, dtype=torch.float32, seed=1)
    assert torch.equal(vmap(dots)(a, b), a @ b.mT)
    assert torch.equal(vmap(dots, (0, None))(a, b[0]), a @ b[0].T)
    assert torch.equal(vmap(dots, (None, 0))(a[0], b), a[0] @ b.mT)
    value, slope = cast(Any, jvp(dots, (a[0], b[0]), (a[1], b[1])))
    assert torch.equal(value, a[0] @ b[0].T)
    assert torch.equal(slope, a[1] @ b[0].T + a[0] @ b[1].T)
    assert torch.equal(jacrev(lambda x: dots(a[0], x).sum())(b[0]), a[0].sum(0).expand(4, 5))
    leaf = a[0].clone().requires_grad_()
    dots(leaf, b[0]).sum().backward()
    assert leaf.grad is not None
    assert torch.equal(leaf.grad, b[0].sum(0).expand(20, 5))


@pytest.mark.parametrize("items", range(1, 19))
@pytest.mark.parametrize("rows", [1, 16, 17, 40])
def test_integer_products_of_any_few_items_are_exact(rows: int, items: int) -> None:
    generator = torch.Generator().manual_seed(rows)
    a, b = (torch.randint(-128, 128, (count, 333), generator=generator, dtype=torch.int8) for count in (rows, items))
    assert (dots(a, b).numpy() == a.numpy().astype(np.int64) @ b.numpy().astype(np.int64).T).all()
    assert dots(a, b).dtype == torch.int32
