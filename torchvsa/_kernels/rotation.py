"""Rotate many rows, each by its own shift.

The plain line gathers element by element. The fast one writes each row twice and copies a window of it, which takes a
twentieth of the time. Measured with `python -m benchmarks --only protection`.
"""

import torch
from jaxtyping import Int, Shaped
from torch import Tensor

from torchvsa._blocks import by_blocks
from torchvsa._checks import mapped
from torchvsa._kernels.look_up import differentiated


def rotate(x: Shaped[Tensor, "*#batch d"], shifts: Int[Tensor, "*#batch"]) -> Shaped[Tensor, "*#batch d"]:
    """Rotate each row to the right by its shift; rows and shifts broadcast."""
    dim = x.shape[-1]
    if shifts.shape != x.shape[:-1]:
        # `torch.broadcast_shapes` would import the symbolic shapes of compilers, which takes a second.
        shifts = torch.broadcast_tensors(x[..., 0], shifts)[1]
        x = x.expand(*shifts.shape, dim)
    # Small types cannot hold every shift up to d, and no type the negative of its lowest number.
    starts = (-shifts.to(torch.int64).remainder(dim)).remainder(dim)
    # Each row is written twice, read and written again: 4 copies.
    rows = by_blocks(roll_rows, x.reshape(-1, dim), starts.reshape(-1), row_bytes=4 * dim * x.element_size())
    return rows.reshape(x.shape)


def roll_rows(rows: Shaped[Tensor, "batch d"], starts: Int[Tensor, "batch"]) -> Shaped[Tensor, "batch d"]:
    """Each row read from index `start` in `[0, d)` to its end, then from its beginning up to `start`."""
    compiling = torch.compiler.is_compiling()
    # The gradient of a window would take d windows per row, export formats have no strided windows, and a compiler for
    # GPUs makes the plain line one pass.
    plain = torch.compiler.is_exporting() or (compiling and rows.device.type != "cpu")
    if plain or differentiated(rows) or mapped(rows, starts):
        columns = torch.arange(rows.shape[1], device=rows.device)
        return rows.gather(-1, (starts[:, None] + columns) % rows.shape[1])
    twice = torch.cat([rows, rows], -1).flatten()
    windows = twice.as_strided((max(twice.numel() - rows.shape[1] + 1, 0), rows.shape[1]), (1, 1))
    return windows.index_select(0, torch.arange(len(rows), device=rows.device) * (2 * rows.shape[1]) + starts)
