"""Policies for the tests, here so that worker processes can import them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


ONE_STEP = np.array([0, 1])


class Counting:
    """A controller whose state is the episode and the step of each robot, `[B, 2]`."""

    def start(self, episodes: Integers) -> Integers:
        """Step 0 of each episode."""
        return np.stack([episodes, np.zeros_like(episodes)], axis=-1)

    def step(self, readings: Floats, state: Integers) -> tuple[Any, Integers]:
        """The commands of this step."""
        return self.commands(readings, *state.T), state + ONE_STEP

    def commands(self, readings: Floats, episodes: Integers, steps: Integers) -> Any:
        """Straight ahead."""
        return np.ones((len(readings), 2))


class Random(Counting):
    """Random wheels, held for half a second, drawn from episode and step."""

    def commands(self, readings: Floats, episodes: Integers, steps: Integers) -> Floats:
        """Uniform in [-1, 1]."""
        draws = [np.random.default_rng([9, e, s // 10]).uniform(-1, 1, 2) for e, s in zip(episodes, steps, strict=True)]
        return np.array(draws)


class Failing(Counting):
    """Breaks in its sixth step."""

    def commands(self, readings: Floats, episodes: Integers, steps: Integers) -> Floats:
        """Straight ahead, until it breaks."""
        if steps.max() >= 5:
            raise RuntimeError("the policy broke")
        return np.ones((len(readings), 2))


class NanInOne(Counting):
    """Commands NaN in episode 2 from its fourth step on."""

    def commands(self, readings: Floats, episodes: Integers, steps: Integers) -> Floats:
        """Straight ahead elsewhere."""
        commands = np.ones((len(readings), 2))
        commands[(episodes == 2) & (steps >= 3), 1] = np.nan
        return commands


def forward(sensors: Floats) -> Floats:
    """Straight ahead."""
    return np.ones((len(sensors), 2))


def still(sensors: Floats) -> Floats:
    """No move."""
    return np.zeros((len(sensors), 2))


random, failing, nan_in_one = Random(), Failing(), NanInOne()
