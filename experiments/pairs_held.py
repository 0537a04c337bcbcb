"""How many random pairs one program holds: the robot, its pairs, and the search for the largest number."""

import time
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

import torchvsa
from behaviours import Actuator, Behaviour, Demonstrations, Rule, Schema, Sensor, Space
from behaviours.learning import no_convergence_warnings
from experiments import presets
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

CLOSED_FORM = "closed_form"
"""The row that is computed and not measured."""

Row = dict[str, Any]


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


def space(vsa: Mapping[str, Any], codes: Mapping[str, Any], dim: int, seed: int) -> Space:
    """Codebooks of `dim` dimensions, for one entry of the setting `codes`."""
    options = dict(codes)
    protection = dict(options.pop("protection"))
    return presets.space_of(
        SCHEMA, torchvsa.architecture(**vsa, dim=dim), {"bins": VALUES, **options}, protection, seed
    )


def parts(config: Mapping[str, Any], learner: str, dim: int, seed: int) -> tuple[Rule, Space]:
    """The rule and the codebooks of a row."""
    row = config["learners"][learner]
    if row["codes"] not in config["codes"]:
        raise ValueError(f"{learner}: there are no codes {row['codes']!r}; choose from {', '.join(config['codes'])}")
    return presets.rule(row["rule"]), space(config["vsa"], config["codes"][row["codes"]], dim, seed)


def measure(config: Mapping[str, Any], learner: str, dim: int, repeat: int) -> tuple[int, list[Row]]:
    """The most pairs that a learner holds with `dim` dimensions, and every program that was asked on the way.

    With the largest dimension the numbers of the setting `pairs` are measured first, and the search goes on below the
    first of them that is not held. Numbers after a recall under the setting `until` are left out.
    """
    seed = int(np.random.SeedSequence([config["seed"], repeat]).generate_state(1)[0])
    rule, codebooks = parts(config, learner, dim, seed)
    rows: list[Row] = []

    @cache
    def recall(count: int) -> float:
        shown = random_pairs(count, seed)
        began = time.perf_counter()
        with no_convergence_warnings():  # the recall says it
            behaviour = rule.fit(codebooks, shown)
        seconds = time.perf_counter() - began
        share = recalled(behaviour, shown)
        report = behaviour.report
        rows.append(
            {
                "learner": learner,
                "dim": dim,
                "repeat": repeat,
                "pairs": count,
                "recall": share,
                "epochs": report.epochs,
                "updates": report.updates,
                "seconds": seconds,
            }
        )
        return share

    def holds(count: int) -> bool:
        return recall(count) >= config["accuracy"]

    start = round(config["learners"][learner]["about"] * dim)
    low, high = 0, None
    if dim == max(config["dims"]):
        for count in sorted(config["pairs"]):
            if not holds(count) and high is None:
                high = count
            elif high is None:
                low = count
            if recall(count) < config["until"]:
                break
    low, high = bracket(holds, start, low, CONDITIONS + 1) if high is None else (low, high)
    return halve(holds, low, high, config["precision"]), rows


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


def recalls(records: list[Row], learner: str, dim: int, pairs: int) -> list[float]:
    """The recall of that many pairs in each repeat that measured it."""
    return [r["recall"] for r in records if (r["learner"], r["dim"], r["pairs"]) == (learner, dim, pairs)]


def expected(dim: int, pairs: int) -> float:
    """The recall of a raw sum of pairs whose conditions are unrelated, in closed form.

    A result of two actuators is half the sum of its two role-bound values, and the best of the nine results is the
    best value of each actuator. So the sum of k pairs is one of 2k, and each actuator's value one of 3 items.
    """
    actuators = len(SCHEMA.actuators)
    return recall_probability("MAP-I", dim, actuators * pairs, LEVELS) ** actuators
