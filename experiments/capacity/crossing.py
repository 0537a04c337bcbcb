"""The number of dimensions at which a growing accuracy, measured with noise, crosses a threshold."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

COARSE = 4
"""Steps of the grid between first guesses."""
_PENALTY = 0.02
"""On the square of the slope: 2 % of that of one error a standard deviation from the middle."""
_STEPS, _SMALL = 100, 1e-9


def window(accuracy: Callable[[int], float], start: int, target: float, floor: float, last: int) -> dict[int, float]:
    """The accuracy at each place of a grid around the one at which it reaches `target`; places grow from 0 to `last`.

    From a place that reaches the target down to the first below `floor`, and up until two in a row have at most half of
    the errors allowed. `accuracy` is asked once for each place; the search begins at `start`.
    """
    asked: dict[int, float] = {}

    def at(place: int) -> float:
        if place not in asked:
            asked[place] = accuracy(place)
        return asked[place]

    top = min(max(start, 0), last)
    while top < last and at(top) < target:
        top = min(top + COARSE, last)
    low = top
    while low > 0 and at(low) >= floor:
        low -= 1
    enough = 1 - (1 - target) / 2
    while top < last and not (at(top) >= enough and at(top - 1) >= enough):
        top += 1
    return {place: at(place) for place in range(low, top + 1)}


def first_at(accuracies: Mapping[int, float], target: float) -> int | None:
    """The smallest number of dimensions whose accuracy reaches the target; None if there is none."""
    return min((dim for dim, share in accuracies.items() if share >= target), default=None)


def crossing(accuracies: Mapping[int, float], decisions: int, target: float) -> float | None:
    """The number of dimensions at which the accuracy is `target`, where each entry is a share of so many `decisions`.

    Near the target the logarithm of the errors falls nearly linearly with log d, so the number of errors is fitted as
    Poisson with the mean `decisions` · e^(a + b·log d), by maximum likelihood. All entries take part: the first one
    that reaches the target is often a lucky one. None where the errors do not fall.
    """
    dims = np.array(sorted(accuracies), dtype=np.float64)
    errors = decisions * (1 - np.array([accuracies[int(dim)] for dim in dims]))
    if len(dims) < 2 or not errors.any():
        return None
    places = np.log(dims)
    center, scale = places.mean(), places.std()
    design = np.stack([np.ones_like(dims), (places - center) / scale], 1)
    # Errors at the fewest dimensions only would make the slope infinite.
    penalty = np.diag([0.0, _PENALTY])
    found = np.array([math.log(errors.mean() / decisions), 0.0])
    for _ in range(_STEPS):  # Newton's method; the likelihood is concave
        means = decisions * np.exp(design @ found)
        gradient = design.T @ (errors - means) - penalty @ found
        step = np.linalg.solve(design.T @ (design * means[:, None]) + penalty, gradient)
        found = found + step / max(1.0, np.abs(step).max())
        if np.abs(step).max() < _SMALL:
            break
    intercept, slope = found
    if not slope < 0:
        return None
    return math.exp(center + scale * (math.log(1 - target) - intercept) / slope)
