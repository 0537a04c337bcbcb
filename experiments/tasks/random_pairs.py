"""Random pairs: conditions of a made-up robot with random results, and how many of them a program recalls."""

from collections.abc import Callable, Sequence

import numpy as np

from behaviours import Actuator, Behaviour, Demonstrations, Schema, Sensor
from torchvsa import recall_probability

VALUES, LEVELS = 20, 3
SCHEMA = Schema(
    [Sensor(name, 0, VALUES) for name in ("left", "right", "front")],
    [Actuator(name, -1, 1, levels=LEVELS) for name in ("left_motor", "right_motor")],
)
"""3 sensors of 20 values, and 9 results: 2 actuators of 3 values."""

CONDITIONS = VALUES ** len(SCHEMA.sensors)
RESULTS = LEVELS ** len(SCHEMA.actuators)
STEP = 1.25
"""The factor by which a search goes up or down until it has found a number on either side."""


def random_pairs(count: int, seed: int) -> Demonstrations:
    """Distinct random conditions with random results; fewer pairs of the same seed are the first ones of more."""
    if not 1 <= count <= CONDITIONS:
        raise ValueError(f"there are {CONDITIONS} different conditions; {count} pairs were asked for")
    rng = np.random.default_rng(seed)
    cells = rng.permutation(CONDITIONS)[:count]
    results = rng.integers(0, RESULTS, CONDITIONS)[:count]
    sensors = np.stack(np.unravel_index(cells, (VALUES,) * len(SCHEMA.sensors)), 1) + 0.5
    commands = np.stack(np.unravel_index(results, (LEVELS,) * len(SCHEMA.actuators)), 1) - 1.0
    return Demonstrations(sensors, commands)


def recalled(behaviour: Behaviour, shown: Demonstrations) -> float:
    """The share of the pairs whose commands are all recalled."""
    return float((behaviour(shown.sensors).commands == shown.commands).all(1).double().mean())


def bracket(holds: Callable[[int], bool], start: int, low: int, end: int) -> tuple[int, int]:
    """A number that holds and a larger one that does not, found from `start` by going up or down by a quarter.

    `low` is taken to hold (0 always does), and `end` not to, without asking.
    """
    if low + 1 >= end:
        return low, end
    count = min(max(start, low + 1), end - 1)
    if holds(count):
        low = count
        while low < end - 1:
            count = min(max(low + 1, round(low * STEP)), end - 1)
            if not holds(count):
                return low, count
            low = count
        return low, end
    high = count
    while (count := int(high / STEP)) > low:
        if holds(count):
            return count, high
        high = count
    return low, high


def halve(holds: Callable[[int], bool], low: int, high: int, precision: float) -> int:
    """The largest number in `[low, high)` that was found to hold, less than a share `precision` below one that fails.

    `low` is known to hold and `high` to fail. What lies between is halved: a recall that rises again further up is
    not seen.
    """
    while high - low > max(1.0, precision * low):
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def most_held(
    recall: Callable[[int], float],
    curve: Sequence[int],
    start: int,
    accuracy: float,
    until: float = 0.0,
    precision: float = 0.0,
) -> int:
    """The most pairs that are recalled with `accuracy`: along the growing numbers of a `curve`, then by search.

    The curve ends with the first recall below `until`; without one the search begins from `start`.
    """

    def holds(count: int) -> bool:
        return recall(count) >= accuracy

    low, high = 0, None
    for count in curve:
        if not holds(count) and high is None:
            high = count
        elif high is None:
            low = count
        if recall(count) < until:
            break
    low, high = bracket(holds, start, low, CONDITIONS + 1) if high is None else (low, high)
    return halve(holds, low, high, precision)


def predicted(dim: int, accuracy: float) -> int:
    """The most pairs that the closed form recalls with `accuracy`."""

    def holds(pairs: int) -> bool:
        return expected(dim, pairs) >= accuracy

    return halve(holds, *bracket(holds, max(dim // 50, 1), 0, 1_000_000), precision=0.0)


def expected(dim: int, pairs: int) -> float:
    """The recall of a raw sum of pairs whose conditions are unrelated, in closed form.

    A result of two actuators is half the sum of its two role-bound values, and the best of the nine results is the
    best value of each actuator. So the sum of k pairs is one of 2k, and each actuator's value one of 3 items.
    """
    actuators = len(SCHEMA.actuators)
    return recall_probability("MAP-I", dim, actuators * pairs, LEVELS) ** actuators
