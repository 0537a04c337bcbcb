"""What a program commands all over sensor space, compared with its teacher."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

import sim
from behaviours import Behaviour, Demonstrations, Policy
from behaviours.ordered import distinct_rows
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
    named = [(left == 1) & (right == 1), (left == -1) & (right == 1), (left == 1) & (right == -1)]
    return np.select(named, [0, 1, 2], 3)


def command_maps(program: Behaviour | Policy, bins: int, held_out: Demonstrations) -> pd.DataFrame:
    """The commands of a program in all cells of all `SLICES`, at its own bins."""
    return pd.concat([command_map(program, bins, plane, held_out) for plane in SLICES], ignore_index=True)


@torch.no_grad()
def command_map(program: Behaviour | Policy, bins: int, plane: Slice, held_out: Demonstrations) -> pd.DataFrame:
    """Ask a program, and the teacher, in every cell of a slice.

    A cell is asked at the middle of each bin, and in the last bin at the end of the range, which is what the corral's
    sensors read where they sense nothing.

    The columns: the title of the `slice`; `row` and `column`, the bins of its y and x; the three readings; the
    commands `learned` and `teacher`, indices into `COMMANDS`; and `samples`, the held-out samples in the cell, of those
    in which the third sensor tells the teacher the same (lit or dark, near or not) as it does in the slice.
    """
    space, teacher = program.space, sim.Teacher()
    row, column = (index.ravel() for index in np.indices((bins, bins)))
    probe = torch.zeros(1, 3, dtype=torch.float64)
    probe[0, plane.third] = plane.fixed
    cells = np.empty((bins * bins, 3), dtype=np.int64)
    cells[:, plane.x], cells[:, plane.y], cells[:, plane.third] = column, row, int(space.cells(probe)[0, plane.third])
    low, high = np.array([(sensor.low, sensor.high) for sensor in sim.SENSORS]).T
    readings = np.where(cells == bins - 1, high, low + (high - low) * (cells + 0.5) / bins)

    below = teacher.obstacle_below if plane.third == DISTANCE else teacher.light_below
    held = held_out.sensors.numpy()[:, plane.third]
    same = (held < below) == (readings[0, plane.third] < below)
    sampled = space.cells(held_out.sensors).numpy()[same]
    samples = np.bincount(sampled[:, plane.y] * bins + sampled[:, plane.x], minlength=bins * bins)
    return pd.DataFrame(
        {
            "slice": plane.title,
            "row": row,
            "column": column,
            **{sensor.name: readings[:, place] for place, sensor in enumerate(sim.SENSORS)},
            "learned": kinds(program(readings).commands.numpy()),
            "teacher": kinds(teacher(readings)),
            "samples": samples,
        }
    )


@torch.no_grad()
def ambiguous_share(program: Behaviour | Policy, train: Demonstrations, held_out: Demonstrations) -> float | None:
    """Of the held-out samples with another command than the teacher's, the share that no program could get right.

    Those are the samples whose condition the teacher answers with several commands, in `train` and `held_out` taken
    together: its threshold runs through their bin. None if there are no differences.
    """
    both = Demonstrations.join([train, held_out])
    frame = pd.DataFrame({"condition": distinct_rows(program.space.cells(both.sensors))[1].numpy()})
    frame["wanted"], frame["given"] = kinds(both.commands.numpy()), kinds(program(both.sensors).commands.numpy())
    frame["ambiguous"] = frame.groupby("condition").wanted.transform("nunique") > 1
    held = frame.iloc[len(train) :]
    differs = held.loc[held.wanted != held.given]
    return None if differs.empty else float(differs.ambiguous.mean())
