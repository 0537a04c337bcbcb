"""What the machine itself can do: fill, copy and read memory, and multiply matrices."""

import torch
from torch import Tensor

from benchmarks.harness import INPUTS, Floor

_SIDE = 2048
"""Rows and columns of the matrices whose product shows the machine's rate."""


def fill(like: Tensor) -> Floor:
    """Writing as many bytes as the result has."""
    outs = [torch.ones_like(like) for _ in range(INPUTS)]
    return Floor("fill", lambda index: outs[index].fill_(1))


def copy(like: Tensor) -> Floor:
    """Reading and writing as many bytes as the result has."""
    sources, outs = ([torch.ones_like(like) for _ in range(INPUTS)] for _ in range(2))
    return Floor("copy", lambda index: outs[index].copy_(sources[index]))


def read(bytes_read: int, device: str) -> Floor:
    """Reading that many bytes."""
    sources = [torch.ones(bytes_read // 8, dtype=torch.int64, device=device) for _ in range(INPUTS)]
    return Floor("read", lambda index: sources[index].sum())


def product(dtype: torch.dtype, multiplications: int, device: str) -> Floor:
    """That many multiplications and additions, at the rate of a large square product in the same type."""
    if dtype == torch.int8:
        a, b = (torch.ones(_SIDE, _SIDE, dtype=dtype, device=device) for _ in range(2))
        return Floor("int8 product", lambda _: torch.ops.aten._int_mm(a, b.T), multiplications / _SIDE**3)
    a, b = (torch.ones(_SIDE, _SIDE, dtype=dtype, device=device) for _ in range(2))
    return Floor(f"{str(dtype).removeprefix('torch.')} product", lambda _: a @ b.T, multiplications / _SIDE**3)
