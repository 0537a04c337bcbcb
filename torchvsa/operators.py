"""Operators of our own, for CPUs: each does what a line or two of PyTorch say, faster.

Operators run outside of graphs, gradients and `vmap`, so that they may write in place and call what has no rules for
those. Where a gradient is wanted, on a GPU and in exported graphs PyTorch's own lines stand instead.
"""

from collections.abc import Callable, Iterator
from functools import reduce
from typing import Any, Literal

import torch
from jaxtyping import Int, Shaped
from torch import Tensor
from torch.autograd import forward_ad

from torchvsa.blocks import CACHE_BYTES


def rotated(
    rows: Shaped[Tensor, "batch d"], starts: Int[Tensor, "batch"], added: Shaped[Tensor, "d"] | None = None
) -> Shaped[Tensor, "batch d"]:
    """Each row from its element `start` in `[0, d)` to its end, then from its beginning.

    With `added`, of the rows' own integer type, each row is its sum with that, clipped to [-1, 1].
    """
    if torch.compiler.is_exporting() or _differentiated(rows):
        # The gradient of a window would be built on all d windows of each row, and export formats know no windows.
        columns = torch.arange(rows.shape[1], device=rows.device)
        return _superposed(rows, added).gather(-1, (starts[:, None] + columns) % rows.shape[1])
    # A compiler copies many rows element by element, but moves a single one within the steps around it.
    if rows.shape[0] > (1 if torch.compiler.is_compiling() else _MANY):
        return torch.ops.torchvsa.rotate(rows, starts, added)
    return _together(_superposed(rows, added), starts)


def looked_up(
    table: Shaped[Tensor, "n entries d"],
    places: Int[Tensor, "batch n"],
    how: Literal["clipped sum", "product", "exclusive or"],
) -> Shaped[Tensor, "batch d"]:
    """The entries `table[i, places[:, i]]` put together: their sum, clipped to [-1, 1], product or exclusive or.

    In the table's own type, which sums must fit.
    """
    plain = torch.compiler.is_compiling() or table.device.type != "cpu" or _differentiated(table)
    if plain or places.shape[0] < _MANY:
        whole = reduce(_STEPS[how], entries(table, places))
        return whole.clamp(-1, 1) if how == "clipped sum" else whole
    return torch.ops.torchvsa.look_up(table, places, how)


_STEPS: dict[str, Callable[[Tensor, Tensor], Tensor]] = {
    "clipped sum": Tensor.add_,
    "product": Tensor.mul_,
    "exclusive or": Tensor.bitwise_xor_,
}


def entries(
    table: Shaped[Tensor, "n entries d"], places: Int[Tensor, "batch n"]
) -> Iterator[Shaped[Tensor, "batch d"]]:
    """`table[i, places[:, i]]` for one i after the other; copied row by row, far faster than by plain indexing."""
    return (one.index_select(0, column) for one, column in zip(table, places.unbind(1), strict=True))


def product(a: Shaped[Tensor, "*batch d"], b: Shaped[Tensor, "k d"]) -> Shaped[Tensor, "*batch k"]:
    """`a @ b.T`; many rows of float32 by oneDNN, whose product was 5 to 15 % faster than that of `@` on an AMD CPU."""
    rows = a.reshape(-1, a.shape[-1])
    plain = a.dtype != torch.float32 or a.device.type != "cpu" or torch.compiler.is_exporting() or not _ONEDNN
    if plain or rows.shape[0] < _MANY_FLOATS or _differentiated(a) or _differentiated(b):
        return a @ b.T
    return torch.ops.torchvsa.product(rows, b).reshape(*a.shape[:-1], len(b))


_MANY, _MANY_FLOATS = 128, 16
"""Rows from which on an operator's own cost is small: those of few bytes that are moved, or that are multiplied."""
_ONEDNN = torch.backends.mkldnn.is_available() and hasattr(torch.ops.mkldnn, "_linear_pointwise")


def _differentiated(x: Tensor) -> bool:
    return x.requires_grad or forward_ad.unpack_dual(x).tangent is not None


def _at_once(rows: Tensor) -> int:
    """Rows that stay in the cache when each is written twice; a GPU takes all."""
    return max(CACHE_BYTES // (2 * rows.shape[1] * rows.element_size()), 1) if rows.device.type == "cpu" else len(rows)


def _superposed(rows: Tensor, added: Tensor | None) -> Tensor:
    return rows if added is None else (rows + added).clamp(-1, 1)


def _together(rows: Tensor, starts: Tensor) -> Tensor:
    # A rotation is a window of the row written twice: copying whole windows beats gathering elements.
    twice = torch.cat([rows, rows], -1).flatten()
    return _windows(twice, rows.shape[1]).index_select(0, _begins(rows) + starts)


def _windows(twice: Tensor, dim: int) -> Tensor:
    return twice.as_strided((max(twice.numel() - dim + 1, 0), dim), (1, 1))


def _begins(rows: Tensor) -> Tensor:
    """Where in the flat tensor of rows written twice each of them begins."""
    return torch.arange(len(rows), device=rows.device) * (2 * rows.shape[1])


@torch.library.custom_op("torchvsa::rotate", mutates_args=())
def _rotate(rows: Tensor, starts: Tensor, added: Tensor | None) -> Tensor:
    answer = rows.new_empty(rows.shape)
    some = _at_once(rows)
    twice = rows.new_empty(min(some, len(rows)), 2, rows.shape[1])
    windows, begins = _windows(twice.view(-1), rows.shape[1]), _begins(rows[:some])
    for start in range(0, len(rows), some):
        block = rows[start : start + some]
        once, again = twice[: len(block)].unbind(1)
        if added is None:
            once.copy_(block)
        else:
            torch.add(block, added, out=once).clamp_(-1, 1)
        again.copy_(once)
        places = begins[: len(block)] + starts[start : start + some]
        torch.index_select(windows, 0, places, out=answer[start : start + some])
    return answer


@torch.library.custom_op("torchvsa::look_up", mutates_args=())
def _look_up(table: Tensor, places: Tensor, how: str) -> Tensor:
    answer = table.new_empty(places.shape[0], table.shape[2])
    some = _at_once(answer)
    entry = answer.new_empty(min(some, len(answer)), answer.shape[1])
    for start in range(0, len(answer), some):
        block, columns = answer[start : start + some], places[start : start + some].unbind(1)
        torch.index_select(table[0], 0, columns[0], out=block)
        for one, column in zip(table[1:], columns[1:], strict=True):
            _STEPS[how](block, torch.index_select(one, 0, column, out=entry[: len(block)]))
        if how == "clipped sum":
            block.clamp_(-1, 1)
    return answer


@torch.library.custom_op("torchvsa::product", mutates_args=())
def _product(a: Tensor, b: Tensor) -> Tensor:
    return torch.ops.mkldnn._linear_pointwise(a, b, None, "none", [], "")


@_rotate.register_fake
def _(rows: Tensor, starts: Tensor, added: Tensor | None) -> Tensor:
    return rows.new_empty(rows.shape)


@_look_up.register_fake
def _(table: Tensor, places: Tensor, how: str) -> Tensor:
    return table.new_empty(places.shape[0], table.shape[2])


@_product.register_fake
def _(a: Tensor, b: Tensor) -> Tensor:
    return a.new_empty(a.shape[0], b.shape[0])


def _stacked(info: Any, in_dims: tuple[int | None, ...], *tensors: Tensor) -> list[Tensor]:
    """The arguments of a mapped operator with the mapped dimension first."""
    return [
        x.expand(info.batch_size, *x.shape) if dim is None else x.movedim(dim, 0)
        for x, dim in zip(tensors, in_dims, strict=True)
    ]


@_rotate.register_vmap
def _(
    info: Any, in_dims: tuple[int | None, ...], rows: Tensor, starts: Tensor, added: Tensor | None
) -> tuple[Tensor, int]:
    rows, starts = _stacked(info, in_dims[:2], rows, starts)
    if in_dims[2] is not None and added is not None:
        rows, added = _superposed(rows, added.movedim(in_dims[2], 0)[:, None]), None
    return _rotate(rows.flatten(0, 1), starts.flatten(), added).unflatten(0, (info.batch_size, -1)), 0


@_look_up.register_vmap
def _(info: Any, in_dims: tuple[int | None, ...], table: Tensor, places: Tensor, how: str) -> tuple[Tensor, int]:
    if in_dims[0] is None:
        places = places.movedim(in_dims[1] or 0, 0)
    else:
        # The lists of all mapped tables become one.
        table, places = _stacked(info, in_dims[:2], table, places)
        places = places + torch.arange(info.batch_size, device=places.device)[:, None, None] * table.shape[2]
        table = table.transpose(0, 1).flatten(1, 2)
    return _look_up(table, places.flatten(0, 1), how).unflatten(0, (info.batch_size, -1)), 0


@_product.register_vmap
def _(info: Any, in_dims: tuple[int | None, ...], a: Tensor, b: Tensor) -> tuple[Tensor, int]:
    a, b = _stacked(info, in_dims, a, b)
    return a @ b.mT, 0
