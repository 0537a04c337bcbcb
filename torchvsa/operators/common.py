"""When an operator takes over, and how many rows it works on at once."""

from typing import Any

from torch import Tensor
from torch.autograd import forward_ad

from torchvsa.blocks import CACHE_BYTES, rows_at_once

MANY = 128
"""Rows from which on an operator that copies them costs little itself."""


def differentiated(x: Tensor) -> bool:
    """Whether a gradient is wanted, backward or forward."""
    return x.requires_grad or forward_ad.unpack_dual(x).tangent is not None


def at_once(rows: Tensor) -> int:
    """Rows of a block in which each is written twice."""
    return rows_at_once(2 * rows.shape[1] * rows.element_size(), rows.device, CACHE_BYTES)


def stacked(info: Any, in_dims: tuple[int | None, ...], *tensors: Tensor) -> list[Tensor]:
    """The arguments of a mapped operator with the mapped dimension first."""
    return [
        x.expand(info.batch_size, *x.shape) if dim is None else x.movedim(dim, 0)
        for x, dim in zip(tensors, in_dims, strict=True)
    ]
