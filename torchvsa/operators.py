"""Two operators of our own, for CPUs: each does what one line of PyTorch says, faster.

Operators run outside of graphs, gradients and `vmap`, so that they may write in place and call what has no rules for
those. Where a gradient is wanted, on a GPU and in exported graphs the line of PyTorch stands instead.
"""

from typing import Any

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
        return _clipped_sum(rows, added).gather(-1, (starts[:, None] + columns) % rows.shape[1])
    # A compiler copies many rows element by element, but moves a single one within the steps around it.
    if rows.shape[0] > (1 if torch.compiler.is_compiling() else _at_once(rows)):
        return torch.ops.torchvsa.rotate(rows, starts, added)
    return _together(_clipped_sum(rows, added), starts)


def product(a: Shaped[Tensor, "*batch d"], b: Shaped[Tensor, "k d"]) -> Shaped[Tensor, "*batch k"]:
    """`a @ b.T`; many rows of float32 by oneDNN, whose product was 5 to 15 % faster than that of `@` on an AMD CPU."""
    rows = a.reshape(-1, a.shape[-1])
    plain = a.dtype != torch.float32 or a.device.type != "cpu" or torch.compiler.is_exporting() or not _ONEDNN
    if plain or rows.shape[0] < _MANY or _differentiated(a) or _differentiated(b):
        return a @ b.T
    return torch.ops.torchvsa.product(rows, b).reshape(*a.shape[:-1], len(b))


_MANY = 16
"""Rows from which on an operator's own cost is small beside that of the product."""
_ONEDNN = torch.backends.mkldnn.is_available() and hasattr(torch.ops.mkldnn, "_linear_pointwise")


def _differentiated(x: Tensor) -> bool:
    return x.requires_grad or forward_ad.unpack_dual(x).tangent is not None


def _at_once(rows: Tensor) -> int:
    """Rows that stay in the cache when each is written twice; a GPU takes all."""
    return max(CACHE_BYTES // (2 * rows.shape[1] * rows.element_size()), 1) if rows.device.type == "cpu" else len(rows)


def _clipped_sum(rows: Tensor, added: Tensor | None) -> Tensor:
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
    some = _at_once(rows)
    if len(rows) <= some:
        return _together(_clipped_sum(rows, added), starts)
    twice, answer = rows.new_empty(some, 2, rows.shape[1]), torch.empty_like(rows)
    windows, begins = _windows(twice.view(-1), rows.shape[1]), _begins(rows[:some])
    for start in range(0, len(rows), some):
        block = rows[start : start + some]
        if added is None:
            twice[: len(block)] = block[:, None]
        else:
            once = twice[: len(block), 0]
            torch.add(block, added, out=once).clamp_(-1, 1)
            twice[: len(block), 1] = once
        places = begins[: len(block)] + starts[start : start + some]
        torch.index_select(windows, 0, places, out=answer[start : start + some])
    return answer


@torch.library.custom_op("torchvsa::product", mutates_args=())
def _product(a: Tensor, b: Tensor) -> Tensor:
    return torch.ops.mkldnn._linear_pointwise(a, b, None, "none", [], "")


@_rotate.register_fake
def _(rows: Tensor, starts: Tensor, added: Tensor | None) -> Tensor:
    return rows.new_empty(rows.shape)


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
        rows, added = _clipped_sum(rows, added.movedim(in_dims[2], 0)[:, None]), None
    return _rotate(rows.flatten(0, 1), starts.flatten(), added).unflatten(0, (info.batch_size, -1)), 0


@_product.register_vmap
def _(info: Any, in_dims: tuple[int | None, ...], a: Tensor, b: Tensor) -> tuple[Tensor, int]:
    a, b = _stacked(info, in_dims, a, b)
    return a @ b.mT, 0
