"""What a program commands all over sensor space, compared with its teacher."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

import sim
from behaviours import Behaviour, Demonstrations, Policy, Schema
from experiments.tasks import corral
from sim.sensors import DISTANCE_MAX, LIGHT_MAX
from sim.teachers.escape import OBSTACLE

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


def kinds(commands: NDArray[np.float64]) -> NDArray[np.int64]:
    """Commands `[N, 2]` as indices into `COMMANDS`."""
    left, right = (corral.schema().command_levels(commands) - 1).numpy().T
    turns = np.where(left < right, 1, 2)
    return np.where(np.abs(left * right) == 0, 3, np.where(left == right, np.where(left > 0, 0, 3), turns))


def cell_readings(schema: Schema, bins: int) -> NDArray[np.float64]:
    """The reading that stands for each bin of each sensor, `[sensors, bins]`.

    The middle of the bin, and for the last bin the end of the range, which is what the corral's sensors read where
    they sense nothing.
    """
    low, high = np.array([(sensor.low, sensor.high) for sensor in schema.sensors]).T
    middles = low[:, None] + (high - low)[:, None] * (np.arange(bins) + 0.5) / bins
    middles[:, -1] = high
    return middles


def command_maps(program: Behaviour | Policy, bins: int, held_out: Demonstrations) -> pd.DataFrame:
    """The commands of a program in all cells of all `SLICES`, at its own bins."""
    return pd.concat([command_map(program, bins, plane, held_out) for plane in SLICES], ignore_index=True)


@torch.no_grad()
def command_map(program: Behaviour | Policy, bins: int, plane: Slice, held_out: Demonstrations) -> pd.DataFrame:
    """Ask a program, and the teacher, in every cell of a slice.

    The columns: the title of the `slice`; `row` and `column`, the bins of its y and x; the three readings; the
    commands `learned` and `teacher`, indices into `COMMANDS`; and `samples`, the held-out samples in the cell, of those
    in which the third sensor tells the teacher the same (lit or dark, near or not) as it does in the slice.
    """
    space = program.space
    cells = cell_readings(space.schema, bins)
    row, column = (index.ravel() for index in np.indices((bins, bins)))
    probe = torch.zeros(1, 3, dtype=torch.float64)
    probe[0, plane.third] = plane.fixed
    readings = np.empty((bins * bins, 3))
    readings[:, plane.x], readings[:, plane.y] = cells[plane.x, column], cells[plane.y, row]
    readings[:, plane.third] = cells[plane.third, int(space.cells(probe)[0, plane.third])]
    same = _sensed(held_out.sensors.numpy(), plane.third) == _sensed(readings[:1], plane.third)
    sampled = space.cells(held_out.sensors).numpy()[same]
    samples = np.bincount(sampled[:, plane.y] * bins + sampled[:, plane.x], minlength=bins * bins)
    return pd.DataFrame(
        {
            "slice": plane.title,
            "row": row,
            "column": column,
            **{sensor.name: readings[:, place] for place, sensor in enumerate(space.schema.sensors)},
            "learned": kinds(program(readings).commands.numpy()),
            "teacher": kinds(sim.Teacher()(readings)),
            "samples": samples,
        }
    )


def _sensed(readings: NDArray[np.float64], sensor: int) -> NDArray[np.bool_]:
    """Whether the teacher senses something with this sensor."""
    teacher = sim.Teacher()
    return readings[:, sensor] < (teacher.obstacle_below if sensor == DISTANCE else teacher.light_below)
