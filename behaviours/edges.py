"""Bin edges at quantiles."""

from typing import Any

import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from behaviours.tables import to_float64
from torchvsa._memory_limit import require_memory


def quantile_edges(readings: Any, bins: int, weights: Float64[Tensor, "N"] | None = None) -> Float64[Tensor, "edges"]:
    """The edges `[bins - 1]` that divide readings `[N]` into `bins` bins of nearly equal counts.

    Each edge is midway between two neighbouring values, so that it always separates some readings from others; edges
    coincide where a value fills more than one bin. NaN is ignored; with fewer than two different values there are no
    edges. With `weights` `[N]`, above 0, a row counts that many times.

    Raises `ValueError` for infinite readings and for fewer than one bin.
    """
    if bins < 1:
        raise ValueError(f"readings need at least one bin; got {bins}")
    readings = to_float64(readings, "readings").flatten()
    if readings.isinf().any():
        raise ValueError("readings must be finite, or NaN for 'not observed'")
    # -0.0 and 0.0 are the same value.
    observed = ~readings.isnan()
    values, index, counts = (readings[observed] + 0.0).unique(return_inverse=True, return_counts=True)
    if len(values) < 2:
        return values[:0]
    # Six tensors of 8 bytes per bin: positions, readings on both sides, and intermediate results.
    require_memory(6 * 8 * bins, f"the edges of {bins:,} bins", "take fewer bins")
    if weights is not None:
        counts = _whole(torch.zeros_like(values).index_add_(0, index, weights.to(values)[observed]))
    mass, edges = counts.cumsum(0), torch.arange(1, bins, device=values.device)
    share, rest = divmod(int(mass[-1]), bins)
    # The first value up to which there are more rows than wanted lies above the edge.
    above = torch.searchsorted(mass, edges * share + edges * rest // bins, right=True).clamp(min=1)
    low, high = values[above - 1], values[above]
    middle = low + (high - low) / 2
    # The difference of large neighbours of opposite signs may overflow.
    middle = torch.where(middle.isinf(), low / 2 + high / 2, middle)
    # The mean of two adjacent floats may be rounded to the lower one, which would not separate them.
    return torch.where(middle > low, middle, high)


_WHOLE = 2**26
"""The mass of all rows if weights are not whole."""


def _whole(mass: Float64[Tensor, "k"]) -> Int64[Tensor, "k"]:
    """Masses as whole numbers: as they are if they are whole, else in parts of `_WHOLE`."""
    total = float(mass.sum())
    if total <= _WHOLE and torch.equal(mass, mass.round()):
        return mass.to(torch.int64)
    return (mass / total * _WHOLE).round().to(torch.int64)
