"""Policies for the tests, here so that worker processes can import them."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def random(sensors: Floats, episodes: Integers, steps: Integers) -> Floats:
    """Random wheels, held for half a second, keyed by episode and step."""
    draws = [np.random.default_rng([9, e, s // 10]).uniform(-1, 1, 2) for e, s in zip(episodes, steps, strict=True)]
    return np.array(draws)


def forward(sensors: Floats, episodes: Integers, steps: Integers) -> Floats:
    """Straight ahead."""
    return np.ones((len(sensors), 2))


def still(sensors: Floats, episodes: Integers, steps: Integers) -> Floats:
    """No move."""
    return np.zeros((len(sensors), 2))


def failing(sensors: Floats, episodes: Integers, steps: Integers) -> Floats:
    """Breaks in its sixth step."""
    if steps.max() >= 5:
        raise RuntimeError("the policy broke")
    return np.ones((len(sensors), 2))


def nan_in_one(sensors: Floats, episodes: Integers, steps: Integers) -> Floats:
    """Commands NaN in episode 2 from its fourth step on."""
    commands = np.ones((len(sensors), 2))
    commands[(episodes == 2) & (steps >= 3), 1] = np.nan
    return commands
