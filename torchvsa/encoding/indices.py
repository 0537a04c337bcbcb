"""Check the rows of indices that encoders are given."""

import torch
from jaxtyping import Int, Int64
from torch import Tensor

from torchvsa._checks import INTEGERS, assertable, readable
from torchvsa.errors import ShapeError

_FEW = 64
"""Indices up to which a list is looked through faster than PyTorch is called."""


def check_indices(indices: Int[Tensor, "batch n"], sensors: int, levels: int) -> Int64[Tensor, "batch n"]:
    """The indices in int64; raises unless they are `[batch, sensors]` whole numbers from -1 to `levels - 1`.

    A CPU looks at the values and names the first that is wrong. Another device asserts them by itself, without being
    waited for: the error comes when its work is next waited for. In graphs and under `vmap` values are not checked.
    """
    if indices.dim() != 2 or indices.shape[1] != sensors:
        raise ShapeError(f"indices must be [batch, {sensors}], one column per sensor; got {tuple(indices.shape)}")
    if indices.dtype not in INTEGERS:
        raise ValueError(f"indices must be integers (-1 where a sensor was not observed); got {indices.dtype}")
    indices = indices.to(torch.int64)
    if readable(indices):
        if not _within(indices, levels):
            row, column = ((indices < -1) | (indices >= levels)).nonzero()[0].tolist()
            raise ValueError(
                f"indices must be -1 (unobserved) or a level from 0 to {levels - 1}; got {int(indices[row, column])} "
                f"in row {row}, column {column}, the index of a sensor"
            )
    elif assertable(indices):
        right = ((indices >= -1) & (indices < levels)).all()
        torch.ops.aten._assert_async.msg(right, f"indices must be -1 (unobserved) or a level from 0 to {levels - 1}")
    return indices


def _within(indices: Tensor, levels: int) -> bool:
    if indices.numel() <= _FEW:
        return all(-1 <= index < levels for row in indices.tolist() for index in row)
    low, high = torch.aminmax(indices)
    return int(low) >= -1 and int(high) < levels
