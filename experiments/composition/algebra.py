"""The algebra of behaviours on the corral robot: mirror images, distance, recognition, interpolation, removal.

Plain functions that return numbers. All of them learn from recorded runs in the default arena, with level codes of 32
bins joined by a product, in d = 4,000, and error-driven.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import spearmanr
from torch import Tensor

import sim
from behaviours import (
    Behaviour,
    BehaviourBank,
    Demonstrations,
    ErrorDriven,
    Rule,
    Space,
    distances,
    recognise,
    switching_weight,
)
from experiments.tasks import corral
from experiments.tasks.agreement import share_right
from torchvsa import MAP
from torchvsa.encoders import Level, Mirrored, Product

Commands = Callable[[NDArray[np.float64]], NDArray[np.float64]]
MIRROR = {"light_left": "light_right", "left_motor": "right_motor"}
DIM, BINS = 4000, 32
FIRST_TESTED = 0
RULE = ErrorDriven()
WEIGHTS = [step / 200 for step in range(1, 200)]
"""The weights at which sums are built; at 0 and 1 there is only one behaviour."""


def runs(rules: Commands, episodes: int, first: int, seconds: float = 60.0) -> Demonstrations:
    """Runs of a rule from the starts `first`, `first + 1`, ...; steps after the lamp was reached are left out."""
    driven = sim.rollout(rules, episodes=range(first, first + episodes), seconds=seconds, engine="vector")
    return corral.moving(driven)


def labelled(readings: Tensor, rules: Commands) -> Demonstrations:
    """Readings with the commands of a rule."""
    return Demonstrations(readings, rules(readings.numpy()))


def space(seed: int, mirror: bool = False) -> Space:
    """The codebooks."""
    values = Level(MAP(DIM, dtype=torch.int8), BINS)
    if mirror:
        return Space(corral.schema(), Mirrored(values, [(0, 1)], 3), seed=seed, mirror=MIRROR)
    return Space(corral.schema(), Product(values, 3), seed=seed)


def sides(shown: Demonstrations) -> dict[str, Demonstrations]:
    """The samples that see the lamp on both sides, on the left only and on the right only."""
    fires = sim.Teacher().rule(shown.sensors.numpy())
    return {name: shown.where(fires == rule) for rule, name in enumerate(("both", "left", "right"))}


def mirrored(codebooks: Sequence[int], demonstrations: int = 20, tested: int = 200) -> list[dict[str, float]]:
    """Learn to go to the lamp without ever seeing it on the right only, and ask about all sides.

    For each codebook the agreement with the teacher of the program `p`, of its mirror image, and of their sum, on the
    side that was shown, the side that was not, and where both sensors see the lamp.
    """
    shown = sides(runs(sim.Teacher(), demonstrations, corral.FIRST_DEMONSTRATION))
    asked = sides(runs(sim.Teacher(), tested, FIRST_TESTED))
    taught = Demonstrations.join([shown["both"], shown["left"]])
    rows = []
    for seed in codebooks:
        p = RULE.fit(space(seed, mirror=True), taught)
        made = {"p": p, "mirror": p.mirror(), "sum": p + p.mirror()}
        rows.append({f"{name}.{side}": share_right(made[name], asked[side]) for name in made for side in asked})
    return rows


def variants(count: int, seed: int) -> list[sim.Teacher]:
    """The teacher with random thresholds of light and obstacles, m."""
    rng = np.random.default_rng(seed)
    return [sim.Teacher(rng.uniform(1.0, 4.0), rng.uniform(0.1, 0.55)) for _ in range(count)]


def distance(
    codebook: int,
    readings: Literal["uniform", "driven"] = "uniform",
    rule: Rule = RULE,
    own: bool = False,
    count: int = 30,
    shown: int = 300,
    tested: int = 4000,
    seed: int = 0,
) -> dict[str, float]:
    """The rank correlation of the distance of programs with the share of readings on which the rules disagree.

    Args:
        codebook: The seed of the codebooks.
        readings: Uniform over the ranges of the sensors, or those of the teacher's runs.
        rule: How programs are learned.
        own: Whether each variant is shown readings of its own; else all are shown the same.
        count: The number of variants.
        shown: Readings that each learns from.
        tested: Readings on which the rules are compared.
        seed: Draws variants and readings.
    """
    rng = np.random.default_rng([seed, 1])
    pool, asked = (pool_of(readings, first, rng) for first in (corral.FIRST_DEMONSTRATION, FIRST_TESTED))
    asked = asked[rng.permutation(len(asked))[:tested]]
    rules, bank = variants(count, seed), BehaviourBank(space(codebook))
    same = rng.permutation(len(pool))[:shown]
    for number, teacher in enumerate(rules):
        chosen = rng.permutation(len(pool))[:shown] if own else same
        bank.learn(str(number), labelled(pool[chosen], teacher), rule)
    commands = np.stack([teacher(asked.numpy()) for teacher in rules])
    found, pairs = distances(bank), list(combinations(range(count), 2))
    disagree = [float((commands[a] != commands[b]).any(-1).mean()) for a, b in pairs]
    ranked: Any = spearmanr([float(found[pair]) for pair in pairs], disagree)
    return {"pairs": len(pairs), "readings": len(asked), "spearman": float(ranked.statistic)}


def pool_of(readings: str, first: int, rng: np.random.Generator) -> Tensor:
    """Distinct readings to draw from."""
    if readings == "driven":
        return torch.unique(runs(sim.Teacher(), 200, first).sensors, dim=0)
    low, high = (np.array([getattr(channel, end) for channel in sim.SENSORS]) for end in ("low", "high"))
    return torch.from_numpy(rng.uniform(low, high, (20_000, len(low))))


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
"""The behaviours to tell apart."""


def recognition(
    codebook: int,
    steps: Sequence[int] = (1, 5, 20, 100),
    sequences: int = 4000,
    demonstrations: int = 100,
    rules: Mapping[str, Commands] = EIGHT,
) -> list[dict[str, float]]:
    """How often the behaviour of a robot is recognised from random steps of one episode, beside the ceiling.

    The ceiling is the share that finds the true rules by a uniform choice among all rules that agree with every step
    that was seen.
    """
    bank = BehaviourBank(space(codebook))
    for name, rule in rules.items():
        bank.learn(name, runs(rule, demonstrations, corral.FIRST_DEMONSTRATION), RULE)
    driven = [runs(rule, 200, FIRST_TESTED) for rule in rules.values()]
    rows = []
    for count in steps:
        truth, shown = sampled(driven, count, sequences, np.random.default_rng([codebook, count]))
        run = torch.arange(len(truth)).repeat_interleave(count)
        found = recognise(bank, shown.sensors, shown.commands, run)
        readings, seen = shown.sensors.numpy(), shown.commands.numpy()
        agree = np.stack([(rule(readings) == seen).all(1).reshape(-1, count).all(1) for rule in rules.values()], 1)
        rows.append(
            {
                "steps": count,
                "sequences": len(truth),
                "recognised": float((found.index.numpy() == truth).mean()),
                "ceiling": float((1 / agree.sum(1)).mean()),
                "where_one_is_left": float((found.index.numpy() == truth)[agree.sum(1) == 1].mean()),
            }
        )
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


def interpolation(codebook: int, demonstrations: int = 20, tested: int = 200) -> dict[str, float]:
    """The weight at which `(1 - w) * seek + w * flee` has left `seek` in half of the readings where they disagree.

    Measured by building the sums, and predicted from the leads of both.
    """
    shown = runs(sim.Teacher(), demonstrations, corral.FIRST_DEMONSTRATION).sensors
    asked = runs(sim.Teacher(), tested, FIRST_TESTED).sensors
    seek, flee = (RULE.fit(space(codebook), labelled(shown, rule)) for rule in (sim.Teacher(), sim.FleeLight()))
    before = seek(asked).commands
    apart = (before != flee(asked).commands).any(1)
    asked, before = asked[apart], before[apart]

    def left(weight: float) -> float:
        made = (1 - weight) * seek + weight * flee
        return float((made(asked).commands != before).any(1).double().mean())

    measured = WEIGHTS[bisect_left(WEIGHTS, 0.5, key=left)]
    return {"readings": len(asked), "measured": measured, "predicted": switching_weight(seek, flee, asked)}


def removal(codebook: int, demonstrations: int = 20) -> bool:
    """Whether `(seek + avoid + cruise) - avoid` equals `seek + cruise` bit for bit, for each of the three."""
    bank = BehaviourBank(space(codebook))
    for name, shown in corral.by_behaviour(runs(sim.Teacher(), demonstrations, corral.FIRST_DEMONSTRATION)).items():
        bank.learn(name, shown, RULE)
    exact = []
    everything = Behaviour.sum([bank[name] for name in bank])
    for name in bank:
        left, wanted = everything - bank[name], Behaviour.sum([bank[other] for other in bank if other != name])
        exact += [
            torch.equal(getattr(left, field), getattr(wanted, field)) for field in ("program", "known", "results")
        ]
    return all(exact)
