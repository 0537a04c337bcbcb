"""Bin edges at quantiles."""

from typing import Any

import torch
from jaxtyping import Float64
from torch import Tensor

from behaviours.tables import to_float64
from torchvsa._memory_limit import require_memory


def quantile_edges(readings: Any, bins: int) -> Float64[Tensor, "edges"]:
    """The edges `[bins - 1]` that divide readings `[N]` into `bins` bins of nearly equal counts.

    Each edge is midway between two neighbouring readings; where readings repeat, edges coincide. NaN is ignored; with
    fewer than two readings there are no edges. Raises `ValueError` for infinite readings and for fewer than one bin.
    """
    if bins < 1:
        raise ValueError(f"readings need at least one bin; got {bins}")
    values = to_float64(readings, "readings").flatten()
    if values.isinf().any():
        raise ValueError("readings must be finite, or NaN for 'not observed'")
    values = values[~values.isnan()].sort().values
    if len(values) < 2:
        return values[:0]
    # Six tensors of 8 bytes per bin: positions, readings on both sides, and intermediate results.
    require_memory(6 * 8 * bins, f"the edges of {bins:,} bins", "take fewer bins")
    above = (torch.arange(1, bins) * len(values)).div(bins, rounding_mode="floor").clamp(min=1)
    low, high = values[above - 1], values[above]
    middle = low + (high - low) / 2
    # The difference of large neighbours of opposite signs may overflow.
    middle = torch.where(middle.isinf(), low / 2 + high / 2, middle)
    # The mean of two adjacent floats may be rounded to the lower one, which would not separate them.
    return torch.where(middle > low, middle, high)
