"""What the machine itself can do: fill, copy and read memory, and multiply matrices."""

import torch
from torch import Tensor

from benchmarks.harness import INPUTS, Floor

_SIDE = {"cpu": 2048, "cuda": 8192}
"""Rows and columns of the matrices whose product shows a device's rate."""


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
    side = _SIDE[device]
    a, b = (torch.ones(side, side, dtype=dtype, device=device) for _ in range(2))
    multiply = torch.ops.aten._int_mm if dtype == torch.int8 else torch.mm
    name = f"{str(dtype).removeprefix('torch.')} product"
    return Floor(name, lambda _: multiply(a, b.T), multiplications / side**3)
