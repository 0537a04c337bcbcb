"""Bin edges at quantiles."""

from typing import Any

import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from behaviours.tables import to_float64
from torchvsa._memory_limit import require_memory


def quantile_edges(readings: Any, bins: int, weights: Float64[Tensor, "N"] | None = None) -> Float64[Tensor, "edges"]:
    """The edges `[bins - 1]` that divide readings `[N]` into `bins` bins of nearly equal mass.

    The mass is spread over the rows, so that bins have nearly equal counts; but the share of the commonest value, at
    most half of the mass, is spread over the distinct values, so that a value that repeats often does not take nearly
    all of the edges. Each edge is midway between two neighbouring distinct values, so that it always separates some
    readings from others; edges coincide where there are more bins than distinct values. NaN is ignored; with fewer than
    two distinct values there are no edges. With `weights` `[N]`, above 0, a row counts that many times.

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
    # In whole numbers: of N rows and k values, a row has mass (256 - s)·k and a value s·N, which is 256·N·k in all.
    rows, distinct = int(counts.sum()), len(values)
    spread = min(_PARTS * int(counts.max()) // rows, _PARTS // 2)
    by_rows = counts.cumsum(0) * ((_PARTS - spread) * distinct)
    mass = by_rows + torch.arange(1, distinct + 1, device=values.device) * (spread * rows)
    share, rest = divmod(_PARTS * rows * distinct, bins)
    edges = torch.arange(1, bins, device=values.device)
    # The first value below which the mass is the wanted one.
    above = torch.searchsorted(mass, edges * share + edges * rest // bins, right=True).clamp(min=1)
    low, high = values[above - 1], values[above]
    middle = low + (high - low) / 2
    # The difference of large neighbours of opposite signs may overflow.
    middle = torch.where(middle.isinf(), low / 2 + high / 2, middle)
    # The mean of two adjacent floats may be rounded to the lower one, which would not separate them.
    return torch.where(middle > low, middle, high)


_PARTS = 256
"""The share of the commonest value is rounded down to a multiple of 1 / 256."""
_WHOLE = 2**26
"""The mass of all rows if weights are not whole; its products with the number of distinct values stay below 2^63."""


def _whole(mass: Float64[Tensor, "k"]) -> Int64[Tensor, "k"]:
    """Masses as whole numbers: as they are if they are whole, else in parts of `_WHOLE`."""
    total = float(mass.sum())
    if total <= _WHOLE and torch.equal(mass, mass.round()):
        return mass.to(torch.int64)
    return (mass / total * _WHOLE).round().to(torch.int64)
