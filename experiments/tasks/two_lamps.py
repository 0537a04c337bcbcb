"""First to one lamp, then to the other: one vector of contexts and transitions, and the second goal never demonstrated.

'To blue' is learned from runs of the teacher towards the blue lamp, with a pair of light sensors per colour. In the
codes one involution swaps the colours, so that `behaviour.mirror()` is 'to yellow'. The transition is learned from the
readings of the same runs, at the blue lamp and before it. See `behaviours.Sequencing`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool
from numpy.typing import NDArray
from torch import Tensor

import sim
from behaviours import BehaviourBank, Demonstrations, Rule, Sequencing, Space
from experiments.tasks import corral
from torchvsa import MAP
from torchvsa.encoders import Level, Mirrored

MIRROR = {"blue_left": "yellow_left", "blue_right": "yellow_right"}
SENSORS = ("blue_left", "blue_right", "distance")
"""The sensors that 'to blue' uses; its mirror image uses the yellow ones."""
TASK = sim.Task(lights=("blue", "yellow"), goals=("blue", "yellow"))


def space(dim: int, bins: int, seed: int) -> Space:
    """Level codes, in which one involution swaps the colours and leaves distance and wheels as they are."""
    columns = [channel.name for channel in TASK.sensors]
    pairs = [(columns.index(first), columns.index(second)) for first, second in MIRROR.items()]
    encoder = Mirrored(Level(MAP(dim, dtype=torch.int8), bins), pairs, len(columns))
    return Space(corral.schema(sensors=TASK.sensors), encoder, seed=seed, mirror=MIRROR)


@dataclass(frozen=True)
class Runs:
    """Runs of the teacher to one lamp.

    Attributes:
        shown: all control steps, until the robot has stayed at the lamp for the dwell time.
        arrived: `[N]`, whether the robot touches the lamp.
    """

    shown: Demonstrations
    arrived: Bool[Tensor, "N"]


def runs(arena: str | sim.Arena, goal: str, episodes: range, seed: int, seconds: float) -> Runs:
    """Runs of the teacher to one lamp only."""
    task = sim.Task(TASK.lights, (goal,))
    driven = sim.rollout(sim.InOrder(task), arena, task=task, episodes=episodes, seed=seed, seconds=seconds)
    shown, _ = corral.shown_in(driven)
    return Runs(shown, torch.from_numpy(driven.trajectory.at_lamp))


def bank(space: Space, taught: Runs, rule: Rule) -> BehaviourBank:
    """'To blue', learned, and 'to yellow', its mirror image."""
    made = BehaviourBank(space)
    made.learn("to blue", taught.shown, rule, sensors=SENSORS)
    made.add("to yellow", made["to blue"].mirror())
    return made


def policy(both: BehaviourBank, taught: Runs, switching: Rule, seed: int) -> Sequencing:
    """Both behaviours and the transition between them in one vector; contexts and tag are drawn from the seed."""
    transitions = {
        ("to blue", "to blue"): taught.shown.where(~taught.arrived),
        ("to blue", "to yellow"): taught.shown.where(taught.arrived),
    }
    return Sequencing(both, transitions, switching, seed=seed)


class AskedOnce:
    """Drives as `policy` does, which is asked once about each condition that a robot meets with each behaviour.

    The state per robot is the index of the behaviour that has the floor.
    """

    def __init__(self, policy: Sequencing) -> None:
        self.policy = policy
        self._known: dict[bytes, tuple[NDArray[np.float64], int]] = {}

    def start(self, episodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """The first behaviour, for each robot."""
        return np.zeros(len(episodes), dtype=np.int64)

    def step(
        self, readings: NDArray[np.float64], floor: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Commands `[B, 2]` for readings `[B, n]`, and the behaviour that speaks, which has the floor then."""
        cells = self.policy.space.cells(readings).numpy()
        keys = [row.tobytes() for row in np.concatenate([cells, floor[:, None]], 1)]
        new = {key: place for place, key in enumerate(keys) if key not in self._known}
        if new:
            places = list(new.values())
            past, _ = self.policy.start(places)
            recall, _ = self.policy.step(readings[places], (past, torch.from_numpy(floor[places])))
            assert recall.speaker is not None
            answers = zip(recall.commands.numpy(), recall.speaker.tolist(), strict=True)
            self._known.update(zip(new, answers, strict=True))
        commands, speakers = zip(*(self._known[key] for key in keys), strict=True)
        return np.stack(commands), np.array(speakers)


class _Speakers(AskedOnce):
    """Answers with the behaviour that speaks instead of commands."""

    def step(
        self, readings: NDArray[np.float64], floor: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """The speaker `[B, 1]` for readings `[B, n]`, and the next state."""
        _, after = super().step(readings, floor)
        return after[:, None].astype(np.float64), after


def speakers(policy: Sequencing, rollout: sim.Rollout) -> list[str]:
    """The name of the behaviour that speaks at each control step of recorded runs."""
    index = sim.replay(_Speakers(policy), rollout.trajectory.sensors, rollout.step_episode)[:, 0]
    return [policy.names[int(number)] for number in index]
