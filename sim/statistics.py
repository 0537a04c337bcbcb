"""Statistics of rollouts: the interval of a success rate, and the median of censored times."""

from __future__ import annotations

import math
from collections.abc import Iterable


def wilson(successes: int, trials: int, z: float = 1.959963984540054) -> tuple[float, float]:
    """Wilson's score interval (low, high) for a proportion; the default `z` gives 95 %.

    Source: Wilson 1927. Raises `ValueError` unless 0 <= successes <= trials and trials > 0.
    """
    if trials <= 0 or not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes of {trials} trials; expected 0 <= successes <= trials, trials > 0")
    rate = successes / trials
    shrink = 1 + z * z / trials
    centre = (rate + z * z / (2 * trials)) / shrink
    spread = z / shrink * math.sqrt(rate * (1 - rate) / trials + z * z / (4 * trials * trials))
    # Without successes or failures the bound is exactly 0 or 1, which rounding would miss.
    low = 0.0 if successes == 0 else max(0.0, centre - spread)
    high = 1.0 if successes == trials else min(1.0, centre + spread)
    return low, high


def censored_median(times: Iterable[float]) -> float | None:
    """The median of `times`, where infinity means "later than observed". None if the median itself is infinite.

    Raises `ValueError` for NaN, and if there are no times.
    """
    ordered = sorted(times)
    if not ordered or any(math.isnan(time) for time in ordered):
        raise ValueError(f"{len(ordered)} times, or NaN among them; expected one number per episode, inf if censored")
    middle = (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2
    return None if math.isinf(middle) else middle
