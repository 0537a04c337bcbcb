"""Rotations of many rows, each by a number of its own.

The plain line gathers element by element; copying windows of rows that are written twice takes a twentieth of the time.
Measured by `python -m benchmarks --only protection`.
"""

import torch
from jaxtyping import Int, Shaped
from torch import Tensor

from torchvsa._checks import mapped
from torchvsa._kernels.look_up import differentiated


def roll_rows(rows: Shaped[Tensor, "batch d"], starts: Int[Tensor, "batch"]) -> Shaped[Tensor, "batch d"]:
    """Each row from its element `start` in `[0, d)` to its end, then from its beginning."""
    compiling = torch.compiler.is_compiling()
    # The gradient of a window would be built on all d windows of each row, export formats know no windows, and a
    # compiler for GPUs makes one pass of the plain line.
    plain = torch.compiler.is_exporting() or (compiling and rows.device.type != "cpu")
    if plain or differentiated(rows) or mapped(rows, starts):
        columns = torch.arange(rows.shape[1], device=rows.device)
        return rows.gather(-1, (starts[:, None] + columns) % rows.shape[1])
    twice = torch.cat([rows, rows], -1).flatten()
    windows = twice.as_strided((max(twice.numel() - rows.shape[1] + 1, 0), rows.shape[1]), (1, 1))
    return windows.index_select(0, torch.arange(len(rows), device=rows.device) * (2 * rows.shape[1]) + starts)
