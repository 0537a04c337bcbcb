"""Collect the columns of a rollout: one row per episode, and one row per control step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.engine import Flags, Floats, Integers, State
from sim.robot import ACTUATORS, CONTROL_HZ
from sim.task import Task
from sim.tracker import Tracker


class EpisodeColumns:
    """Columns with one row per episode, filled when an episode ends."""

    def __init__(self, numbers: Integers) -> None:
        size = len(numbers)
        self.episode = numbers
        self.success = np.zeros(size, dtype=np.bool_)
        self.escaped = np.zeros(size, dtype=np.bool_)
        self.time_to_light = np.full(size, np.nan)
        self.steps = np.zeros(size, dtype=np.int64)
        self.start = np.zeros((size, 3))
        self._contacts = np.zeros(size, dtype=np.int64)
        self._at_lamp = np.zeros(size, dtype=np.int64)
        self._reached = np.zeros(size, dtype=np.int64)

    def count(self, rows: Integers, contact: Flags, at_lamp: Flags, reached: Flags) -> None:
        """Count one control step of the episodes in these rows; `at_lamp` and `reached` are of the last goal."""
        self._contacts[rows] += contact
        self._at_lamp[rows] += at_lamp
        self._reached[rows] += reached

    def finish(self, rows: Integers, tracker: Tracker, slots: Integers) -> None:
        """Fill the rows of the episodes that ended in `slots`."""
        self.success[rows] = tracker.success[slots]
        self.escaped[rows] = tracker.escaped[slots]
        self.steps[rows] = tracker.clock[slots]
        first = tracker.first[slots]
        self.time_to_light[rows] = np.where(first >= 0, first / CONTROL_HZ, np.nan)

    def columns(self) -> dict[str, NDArray[Any]]:
        """The columns, named like the fields of `Rollout`."""
        dwell = np.full(len(self.episode), np.nan)
        np.divide(self._at_lamp, self._reached, out=dwell, where=self._reached > 0)
        return {
            "episode": self.episode,
            "success": self.success,
            "escaped": self.escaped,
            "time_to_light": self.time_to_light,
            "steps": self.steps,
            "dwell": dwell,
            "collisions": self._contacts / self.steps,
            "start": self.start,
        }


class StepColumns:
    """Columns with one row per control step, named like the fields of `Steps`."""

    _NAMES = ("step", "x", "y", "heading", "sensors", "commands", "contact", "at_lamp", "reached", "goal")

    def __init__(self, task: Task) -> None:
        self._steps: list[tuple[NDArray[Any], ...]] = []
        self._widths = {"sensors": len(task.sensors), "commands": len(ACTUATORS)}

    def add(
        self, rows: Integers, state: State, driven: Flags, commands: Floats, tracker: Tracker, slots: Integers
    ) -> None:
        """Add one control step of the episodes in these rows.

        Args:
            rows: Rows of the episodes in `EpisodeColumns`.
            state: State of the robots when the command was given.
            driven: Mask of the robots in `state` that these episodes belong to.
            commands: Their commands.
            tracker: What they have reached by now.
            slots: Their slots there.
        """
        poses = tuple(column[driven] for column in (state.x, state.y, state.heading, state.sensors))
        reached = tracker.at_goal[slots], tracker.first[slots] >= 0, tracker.goal[slots]
        self._steps.append((rows, tracker.clock[slots], *poses, commands.copy(), state.contact[driven], *reached))

    def columns(self, steps: Integers) -> dict[str, NDArray[Any]]:
        """The columns, sorted by episode and step, of episodes with this many `steps`; empty if none was added."""
        kinds: dict[str, Any] = {"step": np.int64, "goal": np.int64}
        kinds |= dict.fromkeys(("contact", "at_lamp", "reached"), np.bool_)
        if not self._steps:
            shapes = {name: (0, width) for name, width in self._widths.items()}
            return {name: np.zeros(shapes.get(name, 0), kinds.get(name, np.float64)) for name in self._NAMES}
        rows, *columns = (np.concatenate(column) for column in zip(*self._steps, strict=True))
        first = np.cumsum(steps) - steps
        place = first[rows] + columns[0]
        sorted_columns = {}
        for name, column in zip(self._NAMES, columns, strict=True):
            sorted_columns[name] = np.empty_like(column)
            sorted_columns[name][place] = column
        return sorted_columns
