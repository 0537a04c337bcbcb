"""The columns of a rollout while it is driven: one row per episode, and one per control step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.robot import ACTUATORS, CONTROL_HZ
from sim.sensors import SENSORS
from sim.tracker import Tracker
from sim.vector_sim import State


class EpisodeColumns:
    """Columns of one row per episode, filled as episodes end."""

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
        places: NDArray[np.int64],
        contact: NDArray[np.bool_],
        at_lamp: NDArray[np.bool_],
        reached: NDArray[np.bool_],
    ) -> None:
        """Count one control step of the episodes at `places`."""
        self._contacts[places] += contact
        self._at_lamp[places] += at_lamp
        self._reached[places] += reached

    def finish(self, place: int, tracker: Tracker, slot: int) -> None:
        """Fill the row of an episode that ended."""
        self.success[place] = tracker.success[slot]
        self.escaped[place] = tracker.escaped[slot]
        self.steps[place] = tracker.clock[slot]
        if tracker.first[slot] >= 0:
            self.time_to_light[place] = tracker.first[slot] / CONTROL_HZ

    def columns(self) -> dict[str, NDArray[Any]]:
        """The columns by the names of the fields of `Rollout`."""
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
    """Columns of one row per control step, gathered tick by tick."""

    def __init__(self, record: bool) -> None:
        self._record = record
        self._ticks: list[tuple[NDArray[Any], ...]] = []

    def add(
        self,
        places: NDArray[np.int64],
        step: NDArray[np.int64],
        state: State,
        chosen: NDArray[np.bool_],
        commands: NDArray[np.float64],
        reached: NDArray[np.bool_],
    ) -> None:
        """Add one control step of the episodes at `places`; `chosen` are their rows in `state`."""
        if self._record:
            seen = (state.x, state.y, state.heading, state.sensors)
            touch = (state.contact, state.at_lamp)
            before, after = (tuple(column[chosen] for column in group) for group in (seen, touch))
            self._ticks.append((places, step, *before, commands.copy(), *after, reached))

    def columns(self) -> dict[str, NDArray[Any]]:
        """The columns by the names of the fields of `Steps`, with `row_` before them, episode by episode."""
        names = ("step", "x", "y", "heading", "sensors", "commands", "contact", "at_lamp", "reached")
        if not self._ticks:
            shapes = {"sensors": (0, len(SENSORS)), "commands": (0, len(ACTUATORS))}
            kinds: dict[str, Any] = {"step": np.int64} | dict.fromkeys(names[-3:], np.bool_)
            return {f"row_{name}": np.zeros(shapes.get(name, 0), kinds.get(name, np.float64)) for name in names}
        places, *columns = (np.concatenate(column) for column in zip(*self._ticks, strict=True))
        order = np.lexsort((columns[0], places))
        return {f"row_{name}": column[order] for name, column in zip(names, columns, strict=True)}
