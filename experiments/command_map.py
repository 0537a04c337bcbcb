"""What a program commands all over sensor space, beside what its teacher does there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

import sim
from behaviours import Behaviour, Demonstrations, Policy, Schema
from experiments.presets import schema as learners_schema
from sim.sensors import DISTANCE_MAX, LIGHT_MAX
from sim.teacher import OBSTACLE

COMMANDS = ("forward", "turn left", "turn right", "other")
"""Names of commands; a command counts by its nearest levels, and what has no name is `other`."""

LEFT, RIGHT, DISTANCE = 0, 1, 2
"""Columns of the readings."""


@dataclass(frozen=True)
class Slice:
    """A plane through sensor space: two sensors vary, the third keeps one reading."""

    x: int
    y: int
    fixed: float
    title: str

    @property
    def third(self) -> int:
        """The sensor that is held."""
        return 3 - self.x - self.y


SLICES = (
    Slice(LEFT, RIGHT, DISTANCE_MAX, "nothing ahead"),
    Slice(LEFT, RIGHT, OBSTACLE / 2, "wall near"),
    Slice(RIGHT, DISTANCE, LIGHT_MAX, "left light dark"),
    Slice(LEFT, DISTANCE, LIGHT_MAX, "right light dark"),
)


@dataclass(frozen=True)
class CommandMap:
    """One slice, cell by cell; rows follow the slice's y, columns its x, both by bin.

    Attributes:
        plane: the slice.
        readings: `[bins, bins, 3]`, what the sensors read in each cell: the middle of the bins, and in a last bin
            the end of the range, which is what the corral's sensors read where they sense nothing.
        learned, teacher: `[bins, bins]`, commands as indices into `COMMANDS`.
        met: `[bins, bins]`, held-out samples in the cell, of those in which the third sensor says the same to the
            teacher (lit or dark, near or not) as it does in the slice.
    """

    plane: Slice
    readings: NDArray[np.float64]
    learned: NDArray[np.int64]
    teacher: NDArray[np.int64]
    met: NDArray[np.int64]

    @property
    def bins(self) -> int:
        """Cells along each side."""
        return len(self.met)

    @property
    def differs(self) -> NDArray[np.bool_]:
        """Cells in which the program does not command what the teacher does."""
        return self.learned != self.teacher


def kinds(commands: NDArray[np.float64]) -> NDArray[np.int64]:
    """Commands `[N, 2]` as indices into `COMMANDS`."""
    left, right = (learners_schema().command_levels(commands) - 1).numpy().T
    turns = np.where(left < right, 1, 2)
    return np.where(np.abs(left * right) == 0, 3, np.where(left == right, np.where(left > 0, 0, 3), turns))


def cell_readings(schema: Schema, bins: int) -> NDArray[np.float64]:
    """The reading that stands for each bin of each sensor, `[sensors, bins]`; see `CommandMap.readings`."""
    low, high = np.array([(sensor.low, sensor.high) for sensor in schema.sensors]).T
    middles = low[:, None] + (high - low)[:, None] * (np.arange(bins) + 0.5) / bins
    middles[:, -1] = high
    return middles


@torch.no_grad()
def command_map(mind: Behaviour | Policy, plane: Slice, heldout: Demonstrations) -> CommandMap:
    """Ask a program, and the teacher, in every cell of a slice at the program's own bins."""
    space = mind.space
    bins = space.encoder.bins
    cells = cell_readings(space.schema, bins)
    readings = np.empty((bins, bins, 3))
    readings[..., plane.x] = cells[plane.x]
    readings[..., plane.y] = cells[plane.y][:, None]
    probe = torch.zeros(1, 3, dtype=torch.float64)
    probe[0, plane.third] = plane.fixed
    readings[..., plane.third] = cells[plane.third, int(space.cells(probe)[0, plane.third])]
    rows = readings.reshape(-1, 3)
    recalled = _in_blocks(lambda block: mind(block).commands.numpy(), rows)
    same = _told(heldout.sensors.numpy(), plane.third) == _told(rows[:1], plane.third)
    where = space.cells(heldout.sensors).numpy()[same]
    met = np.zeros((bins, bins), dtype=np.int64)
    np.add.at(met, (where[:, plane.y], where[:, plane.x]), 1)
    square = (bins, bins)
    return CommandMap(plane, readings, kinds(recalled).reshape(square), kinds(sim.Teacher()(rows)).reshape(square), met)


def _told(readings: NDArray[np.float64], sensor: int) -> NDArray[np.bool_]:
    """Whether the teacher senses something with this sensor."""
    teacher = sim.Teacher()
    return readings[:, sensor] < (teacher.obstacle_below if sensor == DISTANCE else teacher.light_below)


def _in_blocks(ask: Callable[[NDArray[np.float64]], NDArray[np.float64]], rows: NDArray[np.float64]) -> NDArray:
    return np.concatenate([ask(block) for block in np.array_split(rows, max(1, len(rows) // 2048))])
