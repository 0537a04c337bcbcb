"""Boxes and weighted sums side by side, and the share of the dimensions that is of each kind."""

from collections.abc import Callable, Sequence

import torch
from jaxtyping import Float64
from torch import Tensor

from behaviours.learning.leave_one_out import leave_one_out_error
from behaviours.space import Space
from torchvsa import MAP
from torchvsa.encoders import Concatenated, Encoder, ObliqueFeatures, ThresholdFeatures

SHARES = (0.0, 0.25, 0.5)
"""The shares of weighted sums that `chosen_space` compares."""
_MOST = 1000
"""So many rows decide, and so many examples place the weighted sums."""
_FEW = 20
"""Fewer rows do not tell the shares apart."""
_GAIN = 0.05
"""The share of the error of boxes alone by which weighted sums must be better."""


def encoder(
    vsa: MAP,
    share: float,
    examples: Float64[Tensor, "k n"],
    bins: int,
    subset: int,
    edges: Sequence[Float64[Tensor, "_"]],
) -> Encoder:
    """A plan of an encoder with this share of weighted sums, placed by examples in [0, 1]; the rest are boxes."""
    features, oblique = examples.shape[1], round(share * vsa.dim)
    kinds: list[Encoder] = []
    if oblique < vsa.dim:
        kinds.append(ThresholdFeatures(MAP(vsa.dim - oblique, dtype=vsa.dtype), features, bins, subset, edges))
    if oblique:
        kinds.append(ObliqueFeatures(MAP(oblique, dtype=vsa.dtype), features, rows=examples))
    return kinds[0] if len(kinds) == 1 else Concatenated(kinds)


def share_of(space: Space) -> float:
    """The share of weighted sums in a space with such an encoder."""
    parts = [part for part in space.encoder.modules() if isinstance(part, ObliqueFeatures)]
    return sum(part.vsa.dim for part in parts) / space.vsa.dim


def chosen_space(
    of: Callable[[float], Space],
    readings: Float64[Tensor, "N n"],
    wanted: Float64[Tensor, "N m"],
    weights: Float64[Tensor, "N"],
) -> Space:
    """The space with the one of `SHARES` that predicts each row best from all others.

    Boxes alone are kept unless the error is smaller by a twentieth. Takes N² memory: give `some` rows.
    """
    if len(readings) < _FEW:
        return of(0.0)
    spaces, errors = {share: of(share) for share in SHARES}, {}
    for share, space in spaces.items():
        errors[share] = leave_one_out_error(space.encode(space.cells(readings)), wanted, weights)
    best = min(SHARES, key=errors.__getitem__)
    return spaces[best if errors[best] <= (1 - _GAIN) * errors[0.0] else 0.0]


def some(count: int) -> Tensor:
    """Up to `_MOST` rows, drawn at random."""
    return torch.randperm(count, generator=torch.Generator().manual_seed(0))[:_MOST]
