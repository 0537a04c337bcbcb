"""What is measured of the algebra of behaviours on the corral robot: a function for each operation.

All of them learn from recorded runs in the default arena, with level codes joined by a product.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

import sim
from behaviours import (
    Behaviour,
    BehaviourBank,
    Demonstrations,
    ErrorDriven,
    OneShot,
    Rule,
    Space,
    distances,
    recognise,
    switching_weight,
)
from experiments.kit import Row
from experiments.tasks import corral
from experiments.tasks.agreement import share_right
from torchvsa import MAP
from torchvsa.encoders import Level, Mirrored, Product

if TYPE_CHECKING:
    from experiments.composition.algebra import Algebra

Commands = Callable[[NDArray[np.float64]], NDArray[np.float64]]
MIRROR = {"light_left": "light_right", "left_motor": "right_motor"}
FIRST_TESTED = 0
POOL = 20_000
"""Uniform readings to draw from."""
POOL_RUNS = 200
"""Runs of the teacher whose readings are drawn from."""
WEIGHTS = [step / 200 for step in range(1, 200)]
"""The weights at which sums are built; at 0 and 1 there is only one behaviour."""


def cruise(readings: NDArray[np.float64]) -> NDArray[np.float64]:
    """Straight ahead, whatever is sensed."""
    return np.ones((len(readings), 2))


def turn_right(readings: NDArray[np.float64]) -> NDArray[np.float64]:
    """Straight ahead, and to the right before an obstacle; blind to the light."""
    return np.where(readings[:, 2:] < 0.3, [[1.0, -1.0]], [[1.0, 1.0]])


EIGHT: dict[str, Commands] = {
    "escape": sim.Teacher(),
    "flee": sim.FleeLight(),
    "late": sim.Teacher(light_below=1.5),
    "careful": sim.Teacher(obstacle_below=0.35),
    "daring": sim.Teacher(obstacle_below=0.15),
    "arc": sim.Teacher(avoid=(0.0, 1.0)),
    "cruise": cruise,
    "turn_right": turn_right,
}
"""The behaviours to tell apart; `escape` is the teacher of all other operations."""


@dataclass(frozen=True)
class Asked:
    """What a function is asked: the settings of the run, and the seed of the codebooks."""

    settings: Algebra
    seed: int

    @property
    def rule(self) -> Rule:
        """How programs are learned, where nothing else is said."""
        return ErrorDriven(self.settings.margin)

    def space(self, mirror: bool = False) -> Space:
        """The codebooks."""
        values = Level(MAP(self.settings.dim, dtype=torch.int8), self.settings.bins)
        if mirror:
            return Space(corral.schema(), Mirrored(values, [(0, 1)], 3), seed=self.seed, mirror=MIRROR)
        return Space(corral.schema(), Product(values, 3), seed=self.seed)

    def shown(self, rules: str = "escape", episodes: int | None = None) -> Demonstrations:
        """Runs to learn from."""
        count = self.settings.demonstrations if episodes is None else episodes
        return runs(rules, range(corral.FIRST_DEMONSTRATION, corral.FIRST_DEMONSTRATION + count), self.settings.seed)

    def tested(self, rules: str = "escape") -> Demonstrations:
        """Held-out runs."""
        return runs(rules, range(FIRST_TESTED, FIRST_TESTED + self.settings.tested), self.settings.seed)


@cache
def runs(rules: str, episodes: range, seed: int, seconds: float = 60.0) -> Demonstrations:
    """Runs of one of the `EIGHT`; steps after the lamp was reached are left out."""
    return corral.moving(sim.rollout(EIGHT[rules], episodes=episodes, seed=seed, seconds=seconds, engine="vector"))


def labelled(readings: Tensor, rules: Commands) -> Demonstrations:
    """Readings with the commands of a rule."""
    return Demonstrations(readings, rules(readings.numpy()))


def removal(asked: Asked) -> list[Row]:
    """Whether `(seek + avoid + cruise) - avoid` equals `seek + cruise` bit for bit, for each of the three."""
    bank = BehaviourBank(asked.space())
    for name, shown in corral.by_behaviour(asked.shown()).items():
        bank.learn(name, shown, asked.rule)
    exact = []
    everything = Behaviour.sum([bank[name] for name in bank])
    for name in bank:
        left, wanted = everything - bank[name], Behaviour.sum([bank[other] for other in bank if other != name])
        exact += [
            torch.equal(getattr(left, field), getattr(wanted, field)) for field in ("program", "known", "results")
        ]
    return [{"exact": all(exact)}]


def sides(shown: Demonstrations) -> dict[str, Demonstrations]:
    """The samples that see the lamp on both sides, on the left only and on the right only."""
    fires = sim.Teacher().rule(shown.sensors.numpy())
    return {name: shown.where(fires == rule) for rule, name in enumerate(("both", "left", "right"))}


def mirrored(asked: Asked) -> list[Row]:
    """Learn to go to the lamp without ever seeing it on the right only, and ask about all sides.

    A row for the program `p`, its mirror image, and their sum: agreement with the teacher on the side that was shown,
    the side that was not, and where both sensors see the lamp.
    """
    shown, tested = sides(asked.shown()), sides(asked.tested())
    p = asked.rule.fit(asked.space(mirror=True), Demonstrations.join([shown["both"], shown["left"]]))
    made = {"p": p, "mirror": p.mirror(), "sum": p + p.mirror()}
    return [
        {"program": name, **{side: share_right(program, tested[side]) for side in tested}}
        for name, program in made.items()
    ]


def variants(count: int, seed: int) -> list[sim.Teacher]:
    """The teacher with random thresholds of light and obstacles, m."""
    rng = np.random.default_rng(seed)
    return [sim.Teacher(rng.uniform(1.0, 4.0), rng.uniform(0.1, 0.55)) for _ in range(count)]


RULES: dict[str, Callable[[Asked], Rule]] = {
    "error_driven": lambda asked: asked.rule,
    "one_shot": lambda asked: OneShot(),
}


def distance(asked: Asked, readings: str, rule: str, shown: str) -> list[Row]:
    """For each two variants of the teacher: the distance of their programs, and how often the rules disagree.

    Args:
        asked: Settings and codebooks.
        readings: `uniform` over the ranges of the sensors, or those of the teacher's runs, `driven`.
        rule: How programs are learned, by name.
        shown: Whether all variants learn from the `same` readings, or each from its `own`.
    """
    settings = asked.settings
    rng = np.random.default_rng([settings.seed, 1])
    pool, tested = (
        pool_of(readings, first, settings.seed, rng) for first in (corral.FIRST_DEMONSTRATION, FIRST_TESTED)
    )
    tested = tested[rng.permutation(len(tested))[: settings.compared]]
    rules, bank = variants(settings.variants, settings.seed), BehaviourBank(asked.space())
    same = rng.permutation(len(pool))[: settings.readings_shown]
    for number, teacher in enumerate(rules):
        chosen = rng.permutation(len(pool))[: settings.readings_shown] if shown == "own" else same
        bank.learn(str(number), labelled(pool[chosen], teacher), RULES[rule](asked))
    commands, found = np.stack([teacher(tested.numpy()) for teacher in rules]), distances(bank)
    return [
        {"pair": f"{a}-{b}", "distance": float(found[a, b]), "disagreement": disagreement(commands[a], commands[b])}
        for a, b in combinations(range(len(rules)), 2)
    ]


def disagreement(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """The share of rows in which commands differ."""
    return float((one != other).any(-1).mean())


def pool_of(readings: str, first: int, seed: int, rng: np.random.Generator) -> Tensor:
    """Distinct readings to draw from."""
    if readings == "driven":
        return torch.unique(runs("escape", range(first, first + POOL_RUNS), seed).sensors, dim=0)
    low, high = (np.array([getattr(channel, end) for channel in sim.SENSORS]) for end in ("low", "high"))
    return torch.from_numpy(rng.uniform(low, high, (POOL, len(low))))


def recognition(asked: Asked) -> list[Row]:
    """How often the behaviour of a robot is recognised from random steps of one episode, beside the ceiling.

    The ceiling is the share that finds the true rules by a uniform choice among all rules that agree with every step
    that was seen.
    """
    settings, bank = asked.settings, BehaviourBank(asked.space())
    rules = {name: EIGHT[name] for name in settings.behaviours}
    for name in rules:
        bank.learn(name, asked.shown(name, settings.recognition_demonstrations), asked.rule)
    driven = [asked.tested(name) for name in rules]
    rows = []
    for count in settings.steps:
        truth, shown = sampled(driven, count, settings.sequences, np.random.default_rng([asked.seed, count]))
        run = torch.arange(len(truth)).repeat_interleave(count)
        right = recognise(bank, shown.sensors, shown.commands, run).index.numpy() == truth
        readings, seen = shown.sensors.numpy(), shown.commands.numpy()
        agree = np.stack([(rule(readings) == seen).all(1).reshape(-1, count).all(1) for rule in rules.values()], 1)
        candidates = agree.sum(1)
        row: Row = {"steps": count, "sequences": len(truth), "recognised": float(right.mean())}
        row["ceiling"] = float((1 / candidates).mean())
        row["where_one_is_left"] = float(right[candidates == 1].mean()) if (candidates == 1).any() else None
        rows.append(row)
    return rows


def sampled(
    driven: Sequence[Demonstrations], count: int, sequences: int, rng: np.random.Generator
) -> tuple[NDArray[np.int64], Demonstrations]:
    """Sequences of `count` random steps of one episode, as many of each behaviour: whose they are, and the steps."""
    truth, sensors, commands = [], [], []
    for index, shown in enumerate(driven):
        # The steps of an episode follow each other.
        _, starts, lengths = np.unique(shown.episodes.numpy(), return_index=True, return_counts=True)
        chosen = rng.choice(np.flatnonzero(lengths >= count), sequences // len(driven))
        rows = np.concatenate([starts[e] + rng.permutation(lengths[e])[:count] for e in chosen])
        truth += [index] * len(chosen)
        sensors.append(shown.sensors[rows])
        commands.append(shown.commands[rows])
    return np.array(truth), Demonstrations(torch.cat(sensors), torch.cat(commands))


def interpolation(asked: Asked) -> list[Row]:
    """The weight at which `(1 - w) * seek + w * flee` has left `seek` in half of the readings where they disagree.

    Measured by building the sums, and predicted from the leads of both.
    """
    shown, tested = asked.shown().sensors, asked.tested().sensors
    seek, flee = (asked.rule.fit(asked.space(), labelled(shown, EIGHT[name])) for name in ("escape", "flee"))
    before = seek(tested).commands
    apart = (before != flee(tested).commands).any(1)
    tested, before = tested[apart], before[apart]

    def left(weight: float) -> float:
        made = (1 - weight) * seek + weight * flee
        return float((made(tested).commands != before).any(1).double().mean())

    measured = WEIGHTS[min(bisect_left(WEIGHTS, 0.5, key=left), len(WEIGHTS) - 1)]
    predicted = switching_weight(seek, flee, tested)
    return [{"readings_apart": len(tested), "measured": measured, "predicted": predicted}]
