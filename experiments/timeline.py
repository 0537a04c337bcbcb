"""What a program answered, moment by moment, while it drove through one episode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

import sim
from behaviours import Behaviour, Policy
from experiments.command_map import kinds
from sim.teacher import TEACHER_COMMANDS


@dataclass(frozen=True)
class Timeline:
    """One episode; each column has a row per control step.

    Attributes:
        name: of the controller that drove.
        episode: its number.
        seconds: since the start.
        sensors: `[N, 3]`.
        rule: the teacher's rule that would fire, an index into `sim.TEACHER_RULES`.
        differs: whether the command was another than the teacher's.
        similarity, margin, familiarity: of the recall; the margin is NaN where the program knows one result only.
        speaker: which behaviour answered, an index into `voices`; None for a single behaviour.
        voices: the behaviours that were combined.
    """

    name: str
    episode: int
    seconds: NDArray[np.float64]
    sensors: NDArray[np.float64]
    rule: NDArray[np.int64]
    differs: NDArray[np.bool_]
    similarity: NDArray[np.float64]
    margin: NDArray[np.float64]
    familiarity: NDArray[np.float64]
    speaker: NDArray[np.int64] | None
    voices: list[str]


@torch.no_grad()
def timeline(name: str, mind: Behaviour | Policy, rollout: sim.Rollout, episode: int) -> Timeline:
    """Ask a program again for every moment of an episode that it drove."""
    steps = rollout.slice(episode)
    recall = mind(steps.sensors)
    rule = sim.Teacher().rule(steps.sensors)
    margin = recall.margin.numpy().astype(np.float64)
    return Timeline(
        name,
        episode,
        steps.step / sim.CONTROL_HZ,
        steps.sensors,
        rule,
        kinds(recall.commands.numpy()) != kinds(TEACHER_COMMANDS)[rule],
        recall.similarity.numpy().astype(np.float64),
        np.where(np.isfinite(margin), margin, np.nan),
        recall.familiarity.numpy().astype(np.float64),
        None if recall.speaker is None else recall.speaker.numpy(),
        list(mind.names) if isinstance(mind, Policy) else [],
    )


def telling_episode(rollouts: Sequence[sim.Rollout]) -> int | None:
    """The episode that shows most: driven in all rollouts, successful and with all behaviours in as many as can be.

    Among equals, the one whose duration in the last rollout is the median. None if no episode is in all of them.
    """
    if not rollouts:
        return None
    shared = sorted(set.intersection(*(set(rollout.episode.tolist()) for rollout in rollouts)))
    if not shared:
        return None
    merit = {episode: sum(_merit(rollout, episode) for rollout in rollouts) for episode in shared}
    best = [episode for episode in shared if merit[episode] == max(merit.values())]
    best.sort(key=lambda episode: (len(rollouts[-1].slice(episode)), episode))
    return best[(len(best) - 1) // 2]


def _merit(rollout: sim.Rollout, episode: int) -> int:
    """How many behaviours the teacher's rules ask for in an episode, and 3 more for success."""
    rule = sim.Teacher().rule(rollout.slice(episode).sensors)
    shown = sum(bool(np.isin(rule, rules).any()) for rules in sim.BEHAVIOURS.values())
    return shown + 3 * int(rollout.success[rollout.episode == episode][0])
