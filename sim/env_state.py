"""What the two environments share: their spaces, the robots, and the progress of each episode."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sim.arena import Arena
from sim.arenas import find_arena
from sim.channel import Channel
from sim.engine import State, check_commands, control_steps
from sim.engines import find_engine
from sim.robot import CONTROL_HZ
from sim.task import Task, find_task
from sim.tracker import Tracker

MAX_STEPS = 60 * CONTROL_HZ
"""Gymnasium truncates an episode after this many control steps (60 s)."""

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


def box(channels: tuple[Channel, ...]) -> spaces.Box:
    """The space of readings or commands."""
    low, high = np.array([(channel.low, channel.high) for channel in channels]).T
    return spaces.Box(low, high, dtype=np.float64)


def check_render_mode(render_mode: str | None) -> None:
    """Raise `ValueError` for a render mode that the environments do not have."""
    if render_mode not in (None, "rgb_array"):
        raise ValueError(f"render_mode {render_mode!r}; expected None or 'rgb_array'")


class EnvState:
    """The state that both environments share: the robots, their episodes, and the progress of each."""

    def __init__(
        self, size: int, arena: str | Arena, body: str | None, dwell: float, engine: str, task: Task | None
    ) -> None:
        arena = find_arena(arena)
        self.task = find_task(task, arena)
        self.slots = np.arange(size)
        self.tracker = Tracker(size, control_steps(dwell), len(self.task.goals))
        self.engine = find_engine(engine)(size, arena, self.task, body)
        self.episodes = np.zeros(size, dtype=np.int64)

    def reset(self, slots: NDArray[np.int64], episodes: NDArray[np.int64]) -> None:
        """Begin `episodes` in `slots`."""
        self.engine.reset(slots, episodes)
        self.tracker.reset(slots)
        self.episodes[slots] = episodes

    def check_open(self) -> None:
        """Raise if the engine is closed."""
        if self.engine.closed:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed; make a new one")

    def observe(self, slots: NDArray[np.int64] | None = None) -> State:
        """The state of the robots in `slots`, by default of all; their episodes go on by one state."""
        slots = self.slots if slots is None else slots
        state = self.engine.observe(slots)
        self.tracker.observe(slots, state)
        return state

    def drive(self, slots: NDArray[np.int64], action: object) -> None:
        """Drive the robots in `slots` for one control step. Raises `ValueError` unless the commands are finite."""
        commands = check_commands(action, len(slots))
        if not np.isfinite(commands).all():
            raise ValueError(f"action {commands.tolist()}; expected finite commands in [-1, 1]")
        self.engine.drive(slots, commands)

    def info(self, state: State) -> dict[str, NDArray[Any]]:
        """The entries of `info`, with a row for each robot. `state` is that of all robots, as last observed."""
        return {
            "episode": self.episodes.copy(),
            "pose": np.stack([state.x, state.y, state.heading], axis=1),
            "contact": state.contact,
            "at_lamp": self.tracker.at_goal.copy(),
            "escaped": self.tracker.escaped.copy(),
            "success": self.tracker.success.copy(),
        }
