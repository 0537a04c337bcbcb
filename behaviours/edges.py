"""Edges between bins that hold nearly equal numbers of readings."""

from typing import Any

import torch
from jaxtyping import Float64
from torch import Tensor

from behaviours.tables import numbers
from torchvsa._memory_limit import require_memory


def quantile_edges(readings: Any, bins: int) -> Float64[Tensor, "edges"]:
    """The edges `[bins - 1]` that part readings `[N]` into `bins` bins of nearly equal counts.

    An edge lies midway between two neighbouring readings; where readings repeat, edges coincide. NaN is left
    out; without any reading there are no edges. Sees no commands. Raises `ValueError` for infinite readings, and for
    fewer than one bin.
    """
    if bins < 1:
        raise ValueError(f"readings are parted into at least one bin; got {bins}")
    values = numbers(readings, "readings").flatten()
    if values.isinf().any():
        raise ValueError("readings must be finite, or NaN where there is none")
    values = values[~values.isnan()].sort().values
    if len(values) < 2:
        return values[:0]
    # Positions, the readings on both sides, and what lies between them.
    require_memory(6 * 8 * bins, f"the edges of {bins:,} bins", "take fewer bins")
    above = (torch.arange(1, bins) * len(values)).div(bins, rounding_mode="floor").clamp(min=1)
    low, high = values[above - 1], values[above]
    middle = low + (high - low) / 2
    # Neighbours of opposite signs may be further apart than the largest float.
    middle = torch.where(middle.isinf(), low / 2 + high / 2, middle)
    # The mean of two floats side by side may be the lower of them, and would not part them.
    return torch.where(middle > low, middle, high)
