"""Collect the columns of a rollout: one row per episode, and one row per control step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.robot import ACTUATORS, CONTROL_HZ
from sim.sensors import SENSORS
from sim.tracker import Tracker
from sim.vector_sim import State


class EpisodeColumns:
    """Columns with one row per episode, filled when an episode ends."""

    def __init__(self, numbers: NDArray[np.int64]) -> None:
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

    def count(
        self,
        rows: NDArray[np.int64],
        contact: NDArray[np.bool_],
        at_lamp: NDArray[np.bool_],
        reached: NDArray[np.bool_],
    ) -> None:
        """Count one control step of the episodes in these rows."""
        self._contacts[rows] += contact
        self._at_lamp[rows] += at_lamp
        self._reached[rows] += reached

    def finish(self, row: int, tracker: Tracker, slot: int) -> None:
        """Fill the row of the episode that ended in `slot`."""
        self.success[row] = tracker.success[slot]
        self.escaped[row] = tracker.escaped[slot]
        self.steps[row] = tracker.clock[slot]
        if tracker.first[slot] >= 0:
            self.time_to_light[row] = tracker.first[slot] / CONTROL_HZ

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
    """Columns with one row per control step."""

    def __init__(self, record: bool) -> None:
        self._record = record
        self._steps: list[tuple[NDArray[Any], ...]] = []

    def add(
        self,
        rows: NDArray[np.int64],
        step: NDArray[np.int64],
        state: State,
        driven: NDArray[np.bool_],
        commands: NDArray[np.float64],
        reached: NDArray[np.bool_],
    ) -> None:
        """Add one control step of the episodes in these rows.

        Args:
            rows: Rows of the episodes in `EpisodeColumns`.
            step: Index of the control step within each episode.
            state: State of the robots when the command was given.
            driven: Mask of the robots in `state` that these episodes belong to.
            commands: Their commands.
            reached: Whether each of them has touched the lamp by now.
        """
        if self._record:
            poses = tuple(column[driven] for column in (state.x, state.y, state.heading, state.sensors))
            flags = tuple(column[driven] for column in (state.contact, state.at_lamp))
            self._steps.append((rows, step, *poses, commands.copy(), *flags, reached))

    def columns(self) -> dict[str, NDArray[Any]]:
        """The columns, named like the fields of `Steps` with the prefix `row_`, sorted by episode and step."""
        names = ("step", "x", "y", "heading", "sensors", "commands", "contact", "at_lamp", "reached")
        if not self._steps:
            shapes = {"sensors": (0, len(SENSORS)), "commands": (0, len(ACTUATORS))}
            kinds: dict[str, Any] = {"step": np.int64} | dict.fromkeys(names[-3:], np.bool_)
            return {f"row_{name}": np.zeros(shapes.get(name, 0), kinds.get(name, np.float64)) for name in names}
        rows, *columns = (np.concatenate(column) for column in zip(*self._steps, strict=True))
        order = np.lexsort((columns[0], rows))
        return {f"row_{name}": column[order] for name, column in zip(names, columns, strict=True)}
