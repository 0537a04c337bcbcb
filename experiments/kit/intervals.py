"""Intervals at 95 %: Wilson's for one proportion, the bootstrap over what was drawn where there are several draws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

LEVEL = 0.95


def proportion(name: str, successes: int, trials: int) -> dict[str, Any]:
    """Columns of a row: `{name}_rate`, `{name}_low` and `{name}_high`, Wilson's; None if there were no trials."""
    from sim.statistics import wilson  # with the robot, which takes half a second to load

    columns = (f"{name}_rate", f"{name}_low", f"{name}_high")
    if not trials:
        return dict.fromkeys(columns)
    return dict(zip(columns, (successes / trials, *wilson(successes, trials)), strict=True))


def mean(name: str, values: ArrayLike) -> dict[str, Any]:
    """Columns of a row: the mean of draws as `{name}`, and its bootstrap as `{name}_low` and `{name}_high`.

    The bounds of a single draw are None, and so is all of none.
    """
    drawn = np.asarray(values, dtype=np.float64)
    low, high = bootstrap(drawn) if len(drawn) > 1 else (None, None)
    return {name: float(drawn.mean()) if len(drawn) else None, f"{name}_low": low, f"{name}_high": high}


def bootstrap(
    values: ArrayLike, statistic: Callable[..., Any] = np.mean, seed: int = 0, draws: int = 2000
) -> tuple[float, float]:
    """The percentile interval (low, high) of a statistic over independent draws, e.g. codebooks, starts or folds.

    One draw gives (NaN, NaN), since it says nothing about others. Source: Efron 1979.
    """
    sample = np.asarray(values, dtype=np.float64)
    if not len(sample):
        raise ValueError("an interval needs at least one value")
    if len(sample) == 1:
        return float("nan"), float("nan")
    places = np.random.default_rng(seed).integers(0, len(sample), (draws, len(sample)))
    found = np.array([statistic(row) for row in sample[places]])
    low, high = np.quantile(found, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)


def bootstrap_nested(
    samples: Sequence[Sequence[float]], drawn: bool = True, seed: int = 0, draws: int = 2000
) -> tuple[float, float]:
    """The percentile interval (low, high) of the mean over samples, e.g. the starts of each of several runs.

    Each draw takes as many samples as there are, with replacement, and of each of them as many values as it has; where
    the samples are not `drawn`, but all that are asked about, each of them once. The statistic is the mean of the
    samples' means. One value gives (NaN, NaN). Source: Davison and Hinkley 1997, sections 3.2 and 3.8.
    """
    known = [np.asarray(sample, dtype=np.float64) for sample in samples]
    if not known or not all(map(len, known)):
        raise ValueError("an interval needs at least one value in each sample")
    if len(known) == 1 or all(len(sample) == 1 for sample in known):
        return bootstrap(np.concatenate(known).tolist(), seed=seed, draws=draws)
    generator = np.random.default_rng(seed)
    places = np.arange(len(known))
    chosen = generator.integers(0, len(known), (draws, len(known))) if drawn else np.tile(places, (draws, 1))
    means = np.empty(chosen.shape)
    for place, sample in enumerate(known):
        at = np.nonzero(chosen == place)
        means[at] = [sample[generator.integers(0, len(sample), len(sample))].mean() for _ in at[0]]
    low, high = np.quantile(means.mean(axis=1), [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)
