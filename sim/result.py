"""The result of a rollout: one row per episode, one row per control step, and a summary."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sim.arena import Arena
from sim.robot import CONTROL_HZ
from sim.statistics import censored_median, wilson
from sim.task import Task

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Steps:
    """Control steps, one row each: the state before the command, and the command.

    Attributes:
        step: `[N]`, index within the episode, from 0.
        x, y: `[N]`, m; heading: `[N]`, rad.
        sensors: `[N, n]`, see `Task.sensors`.
        commands: `[N, 2]`, before clipping and wheel noise.
        contact: `[N]`, whether the robot touches an obstacle.
        at_lamp: `[N]`, whether it touches the lamp that is its goal.
        reached: `[N]`, whether it touches the lamp of its last goal or did earlier in the episode.
        goal: `[N]`, the index of its goal in `Task.goals`.
    """

    step: Integers
    x: Floats
    y: Floats
    heading: Floats
    sensors: Floats
    commands: Floats
    contact: Flags
    at_lamp: Flags
    reached: Flags
    goal: Integers

    def __len__(self) -> int:
        return len(self.step)

    def rows(self, selection: slice | Integers | Flags) -> Steps:
        """The rows that a slice, indices or a mask select."""
        return Steps(**{field.name: getattr(self, field.name)[selection] for field in fields(self)})


@dataclass(frozen=True)
class Summary:
    """Summary statistics of a rollout; rates are fractions.

    Attributes:
        episodes: number of episodes.
        success_rate: with its Wilson 95 % interval `success_low`, `success_high`.
        escape_rate: fraction of the episodes in which the robot left the corral.
        time_to_light_s: median time to the first touch of the (last) lamp, failures censored; None if the median is.
        dwell_fraction: fraction of the control steps at the lamp since first reaching it; None if no robot did.
        collision_fraction: fraction of all control steps in contact with an obstacle.
    """

    episodes: int
    success_rate: float
    success_low: float
    success_high: float
    escape_rate: float
    time_to_light_s: float | None
    dwell_fraction: float | None
    collision_fraction: float


@dataclass(frozen=True)
class Rollout:
    """Episodes of one controller in one arena.

    Attributes:
        arena, task, engine, body, seed, seconds, dwell_seconds: the arguments of `rollout`.
        episode: `[E]`, the numbers of the episodes.
        success: `[E]`, whether the robot stayed at the lamp for the dwell time, which ends the episode early.
        escaped: `[E]`, whether it left the corral at any time.
        time_to_light: `[E]`, time to the first touch of the (last) lamp in s, NaN if there was none.
        steps: `[E]`, number of control steps.
        dwell: `[E]`, fraction of the control steps at the lamp since first reaching it, NaN if it never did.
        collisions: `[E]`, fraction of the control steps in contact with an obstacle.
        start: `[E, 3]`, x, y, heading.
        trajectory: the control steps of all episodes, concatenated; empty if not recorded.
        offsets: `[E + 1]`; rows `offsets[e]:offsets[e + 1]` of `trajectory` belong to episode e.
    """

    arena: Arena
    task: Task
    engine: str
    body: str
    seed: int
    seconds: float
    dwell_seconds: float
    episode: Integers
    success: Flags
    escaped: Flags
    time_to_light: Floats
    steps: Integers
    dwell: Floats
    collisions: Floats
    start: Floats
    trajectory: Steps
    offsets: Integers

    def __len__(self) -> int:
        return len(self.episode)

    @property
    def recorded(self) -> bool:
        """Whether the control steps were recorded."""
        return len(self.trajectory) > 0

    @property
    def step_episode(self) -> Integers:
        """The episode of each row of `trajectory`, `[N]`."""
        return np.repeat(self.episode, np.diff(self.offsets))

    def slice(self, episode: int) -> Steps:
        """The trajectory of one episode, by its number. Raises `KeyError` if it is missing or was not recorded."""
        (rows,) = np.nonzero(self.episode == episode)
        if not rows.size:
            raise KeyError(
                f"episode {episode} is not in this rollout of {len(self)} episodes, "
                f"{self.episode.min()} to {self.episode.max()}"
            )
        if not self.recorded:
            raise KeyError(f"episode {episode} has no trajectory; roll out with record=True")
        row = int(rows[0])
        return self.trajectory.rows(slice(int(self.offsets[row]), int(self.offsets[row + 1])))

    def summary(self) -> Summary:
        """Summary statistics of this rollout."""
        low, high = wilson(int(self.success.sum()), len(self))
        reached = ~np.isnan(self.dwell)
        # Weights: the control steps since first reaching the lamp, so that every step counts the same.
        since = self.steps[reached] - np.rint(self.time_to_light[reached] * CONTROL_HZ).astype(np.int64)
        return Summary(
            episodes=len(self),
            success_rate=float(self.success.mean()),
            success_low=low,
            success_high=high,
            escape_rate=float(self.escaped.mean()),
            time_to_light_s=censored_median(np.where(self.success, self.time_to_light, np.inf).tolist()),
            dwell_fraction=float(np.average(self.dwell[reached], weights=since)) if reached.any() else None,
            collision_fraction=float(np.average(self.collisions, weights=self.steps)),
        )
