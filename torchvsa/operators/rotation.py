"""Rotations of many rows, each by a number of its own."""

from typing import Any

import torch
from jaxtyping import Int, Shaped
from torch import Tensor

from torchvsa.operators.common import MANY, at_once, differentiated, stacked


def rotated(
    rows: Shaped[Tensor, "batch d"], starts: Int[Tensor, "batch"], added: Shaped[Tensor, "d"] | None = None
) -> Shaped[Tensor, "batch d"]:
    """Each row from its element `start` in `[0, d)` to its end, then from its beginning.

    With `added`, of the rows' own integer type, each row is its sum with that, clipped to [-1, 1].
    """
    compiling = torch.compiler.is_compiling()
    if torch.compiler.is_exporting() or differentiated(rows) or (compiling and rows.device.type != "cpu"):
        # The gradient of a window would be built on all d windows of each row, export formats know no windows, and a
        # compiler for GPUs makes one pass of this.
        columns = torch.arange(rows.shape[1], device=rows.device)
        return _superposed(rows, added).gather(-1, (starts[:, None] + columns) % rows.shape[1])
    # A compiler for CPUs copies many rows element by element, but moves a single one within the steps around it.
    if rows.shape[0] < (2 if compiling else MANY):
        return _together(_superposed(rows, added), starts)
    return torch.ops.torchvsa.rotate(rows, starts, added)


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
    some = at_once(rows)
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


@_rotate.register_fake
def _(rows: Tensor, starts: Tensor, added: Tensor | None) -> Tensor:
    return rows.new_empty(rows.shape)


@_rotate.register_vmap
def _(
    info: Any, in_dims: tuple[int | None, ...], rows: Tensor, starts: Tensor, added: Tensor | None
) -> tuple[Tensor, int]:
    rows, starts = stacked(info, in_dims[:2], rows, starts)
    if in_dims[2] is not None and added is not None:
        rows, added = _superposed(rows, added.movedim(in_dims[2], 0)[:, None]), None
    return _rotate(rows.flatten(0, 1), starts.flatten(), added).unflatten(0, (info.batch_size, -1)), 0
