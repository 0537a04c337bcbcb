"""Where a controller fails: where its robot ended, and which commands led there."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

import sim
from behaviours import Behaviour, Demonstrations, Policy
from behaviours.ordered import distinct_rows
from experiments.corral.command_map import COMMANDS, kinds
from sim.teachers.escape import TEACHER_COMMANDS

PLACES = ("inside the corral", "outside, away from the lamp", "at the lamp, not long enough")
"""Where a robot that did not succeed can be at the end."""


def ends(rollout: sim.Rollout) -> list[str | None]:
    """Where each robot of a recorded rollout was at the end, one of `PLACES`; None for those that succeeded."""
    path, last = rollout.trajectory, rollout.offsets[1:] - 1
    inside = rollout.arena.floor.holds(path.x[last], path.y[last])
    place = np.where(path.at_lamp[last], 2, np.where(inside, 0, 1)).tolist()
    return [None if success else PLACES[at] for at, success in zip(place, rollout.success.tolist(), strict=True)]


def unlike_teacher(rollout: sim.Rollout) -> NDArray[np.int64]:
    """For each episode, the control steps in which the teacher would have commanded otherwise."""
    _, given, wanted = _commands(rollout.trajectory)
    return np.add.reduceat(given != wanted, rollout.offsets[:-1], dtype=np.int64)


def mistakes(rollout: sim.Rollout) -> list[dict[str, Any]]:
    """The commands in failing episodes that are not the teacher's, the most frequent first.

    Each row has the teacher's `rule`, the `command` given instead, its `share` of all control steps of these episodes,
    and the median readings.
    """
    failing = np.repeat(~rollout.success, np.diff(rollout.offsets))
    if not failing.any():
        return []
    path = rollout.trajectory.rows(failing)
    rule, given, wanted = _commands(path)
    wrong = given != wanted
    rows = []
    for index, command in np.unique(np.stack([rule[wrong], given[wrong]], 1), axis=0).tolist():
        at = wrong & (rule == index) & (given == command)
        median = dict(zip((sensor.name for sensor in sim.SENSORS), np.median(path.sensors[at], axis=0), strict=True))
        rows.append(
            {"rule": sim.TEACHER_RULES[index], "command": COMMANDS[command], "share": float(at.mean()), **median}
        )
    return sorted(rows, key=lambda row: -row["share"])


def _commands(path: sim.Steps) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """The teacher's rule, the command given, and the teacher's command, at each control step."""
    rule = sim.Teacher().rule(path.sensors)
    return rule, kinds(np.clip(path.commands, -1, 1)), kinds(TEACHER_COMMANDS)[rule]


@torch.no_grad()
def ambiguous_share(program: Behaviour | Policy, train: Demonstrations, held_out: Demonstrations) -> float | None:
    """Of the held-out samples with another command than the teacher's, the share that no program could get right.

    Those are the samples whose condition the teacher answers with several commands, in `train` and `held_out` taken
    together: its threshold runs through their bin. None if there are no differences.
    """
    both = Demonstrations.join([train, held_out])
    condition = distinct_rows(program.space.cells(both.sensors))[1].numpy()
    answers, wanted = kinds(program(both.sensors).commands.numpy()), kinds(both.commands.numpy())
    counts = np.zeros((condition.max() + 1, len(COMMANDS)), dtype=np.int64)
    np.add.at(counts, (condition, wanted), 1)
    several = (counts > 0).sum(1) > 1
    differs = (answers != wanted)[len(train) :]
    return float(several[condition][len(train) :][differs].mean()) if differs.any() else None
