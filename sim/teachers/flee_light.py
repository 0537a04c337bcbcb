"""Flee from light: turn away from it, and drive where it is dark."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.task import Task
from sim.teachers.escape import sensed


class FleeLight:
    """Four rules: light on the right or on both sides, turn left; light on the left, turn right; obstacle, turn left;
    else straight ahead.

    `teacher(sensors [B, n]) -> commands [B, 2]`. `light` is the colour to flee from, by default the first of the task.
    """

    def __init__(self, task: Task = Task(), light: str | None = None) -> None:
        self.task = task
        self.pair = task.pair(task.lights[0] if light is None else light)

    def __call__(self, sensors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Commands `[B, 2]` for `sensors` `[B, n]`."""
        left, right, obstacle = sensed(sensors, self.task, self.pair)
        turn = np.where(right, 1, np.where(left, -1, np.where(obstacle, 1, 0)))[:, None]
        return np.where(turn == 0, 1.0, turn * np.array([-1.0, 1.0]))
