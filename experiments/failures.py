"""Where a controller fails: where its robot ended, and which commands led there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

import sim
from behaviours import Behaviour, Demonstrations, Policy
from experiments.command_map import COMMANDS, kinds
from sim.teacher import TEACHER_COMMANDS

PLACES = ("inside the corral", "outside, away from the lamp", "at the lamp, not long enough")
"""Where a robot that did not succeed can be at the end."""


@dataclass(frozen=True)
class Mistake:
    """One command given where the teacher would have followed a rule that asks for another.

    Attributes:
        rule: of the teacher.
        command: given instead, a name in `COMMANDS`.
        share: of all control steps of the failing episodes.
        readings: `[3]`, the median readings at which it happened.
    """

    rule: str
    command: str
    share: float
    readings: NDArray[np.float64]


@dataclass(frozen=True)
class Failures:
    """The failing episodes of one rollout.

    Attributes:
        episodes: their numbers.
        ends: how many ended in each of `PLACES`.
        wrong: share of their control steps in which the teacher would have commanded otherwise.
        mistakes: the most frequent first.
    """

    episodes: NDArray[np.int64]
    ends: dict[str, int]
    wrong: float
    mistakes: list[Mistake]


def failures(rollout: sim.Rollout) -> Failures:
    """Collect the failing episodes of a recorded rollout."""
    failed = ~rollout.success
    if not failed.any():
        return Failures(rollout.episode[failed], dict.fromkeys(PLACES, 0), 0.0, [])
    path = rollout.trajectory
    last = rollout.offsets[1:][failed] - 1
    half = rollout.arena.side / 2
    inside = (np.abs(path.x[last]) < half) & (np.abs(path.y[last]) < half)
    place = np.where(path.at_lamp[last], 2, np.where(inside, 0, 1))
    own = np.repeat(failed, np.diff(rollout.offsets))
    sensors = path.sensors[own]
    rule = sim.Teacher().rule(sensors)
    given, wanted = kinds(np.clip(path.commands[own], -1, 1)), kinds(TEACHER_COMMANDS)[rule]
    wrong = given != wanted
    mistakes = []
    for which, command in np.unique(np.stack([rule[wrong], given[wrong]], 1), axis=0).tolist():
        at = wrong & (rule == which) & (given == command)
        mistakes.append(
            Mistake(sim.TEACHER_RULES[which], COMMANDS[command], float(at.mean()), np.median(sensors[at], axis=0))
        )
    return Failures(
        rollout.episode[failed],
        {name: int((place == index).sum()) for index, name in enumerate(PLACES)},
        float(wrong.mean()),
        sorted(mistakes, key=lambda mistake: -mistake.share),
    )


@torch.no_grad()
def on_the_edge(mind: Behaviour | Policy, train: Demonstrations, heldout: Demonstrations) -> float | None:
    """Of the held-out samples with another command than the teacher's, the share that no program could get right.

    Those are the samples whose condition the teacher answers with several commands, in `train` and `heldout` taken
    together: its threshold runs through their bin. None if there are no differences.
    """
    both = Demonstrations.join([train, heldout])
    bins = mind.space.cells(both.sensors).numpy()
    # One number per condition sorts far faster than rows.
    keys = np.ravel_multi_index(tuple((bins + 1).T), (mind.space.encoder.bins + 1,) * bins.shape[1])
    _, first, condition = np.unique(keys, return_index=True, return_inverse=True)
    answers = np.concatenate([kinds(mind(block).commands.numpy()) for block in both.sensors[first].split(2048)])
    wanted = kinds(both.commands.numpy())
    counts = np.zeros((len(first), len(COMMANDS)), dtype=np.int64)
    np.add.at(counts, (condition, wanted), 1)
    several = (counts > 0).sum(1) > 1
    differs = (answers[condition] != wanted)[len(train) :]
    return float(several[condition][len(train) :][differs].mean()) if differs.any() else None
