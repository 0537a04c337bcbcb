"""What a rollout leaves behind: one row an episode, one row a control step, and their summary."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sim.corral import Arena
from sim.robot import CONTROL_HZ
from sim.statistics import censored_median, wilson

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Steps:
    """Control steps, one row each: the state in which a command was given, and the command.

    Attributes:
        step: `[N]`, index within the episode, from 0.
        x, y: `[N]`, m; heading: `[N]`, rad.
        sensors: `[N, 3]`, see `sim.sensors.SENSORS`.
        commands: `[N, 2]`, as the policy gave them, before clipping and wheel noise.
        contact: `[N]`, touching a wall.
        at_lamp: `[N]`, touching the lamp.
        reached: `[N]`, has touched the lamp, now or earlier in the episode.
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

    def __len__(self) -> int:
        return len(self.step)

    def rows(self, which: slice | Integers | Flags) -> Steps:
        """The chosen rows: a slice, indices or a mask."""
        return Steps(**{field.name: getattr(self, field.name)[which] for field in fields(self)})


@dataclass(frozen=True)
class Summary:
    """The figures of a rollout; rates are fractions.

    Attributes:
        episodes: number of episodes.
        success_rate: with its Wilson 95 % interval `success_low`, `success_high`.
        escape_rate: episodes in which the robot left the corral.
        time_to_light_s: median time to the first touch of the lamp, failures censored; None where the median is.
        dwell_fraction: control steps at the lamp of all after first reaching it; None if no robot reached it.
        collision_fraction: control steps in contact with a wall, of all.
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
    """Episodes of one policy in one arena.

    Attributes:
        arena, body, seed, seconds, dwell_seconds: the conditions.
        episode: `[E]`, as asked for.
        success: `[E]`, at the lamp throughout the dwell time; the episode ended then, else at `seconds`.
        escaped: `[E]`, left the corral at any time.
        time_to_light: `[E]`, s to the first touch of the lamp, NaN if there was none.
        steps: `[E]`, control steps driven.
        dwell: `[E]`, fraction of the control steps since first reaching the lamp that were at it, NaN if none.
        collisions: `[E]`, fraction of the control steps in contact with a wall.
        start: `[E, 3]`, x, y, heading.
        trajectory: the control steps of all episodes, one after the other; empty if not recorded.
        offsets: `[E + 1]`; episode e owns rows `offsets[e]:offsets[e + 1]` of `trajectory`.
    """

    arena: Arena
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
        """Whether the control steps were kept."""
        return len(self.trajectory) > 0

    @property
    def step_episode(self) -> Integers:
        """The episode of each row of `trajectory`, `[N]`."""
        return np.repeat(self.episode, np.diff(self.offsets))

    def slice(self, episode: int) -> Steps:
        """The trajectory of one episode, by its number. Raises `KeyError` if it is not there or was not recorded."""
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
        """The figures of this rollout."""
        low, high = wilson(int(self.success.sum()), len(self))
        reached = ~np.isnan(self.dwell)
        # Steps since first reaching the lamp, so that episodes are pooled step by step.
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
