"""Follow the wall on the right, with nothing but the distance ahead."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.task import Task
from sim.teachers.escape import sensed

INNER_WHEEL = 0.85
"""Speed of the right wheel on the arc back to the wall: a circle of 1.6 m radius, which fits in few corrals."""


class WallFollowing:
    """Two rules: obstacle ahead, turn left; else an arc to the right, which leads back to the wall.

    `teacher(sensors [B, n]) -> commands [B, 2]`. Light is ignored.
    """

    def __init__(self, task: Task = Task()) -> None:
        self.task = task

    def __call__(self, sensors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Commands `[B, 2]` for `sensors` `[B, n]`."""
        *_, obstacle = sensed(sensors, self.task, (0, 1))
        return np.where(obstacle[:, None], np.array([-1.0, 1.0]), np.array([1.0, INNER_WHEEL]))
