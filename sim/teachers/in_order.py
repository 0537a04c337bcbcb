"""Go to several lamps, one after the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.task import Task
from sim.teachers.escape import TEACHER_COMMANDS, Teacher

AT_LAMP = 0.1135
"""The mean of both light readings, m, below which a robot touches a lamp of .15 m radius.

Touching it (a gap of .005 m) the mean is .1142 m, whatever the heading between ±20°.
"""


class InOrder:
    """The five rules for each goal of a task in turn; at its lamp the robot turns to the next one.

    A controller whose state `[B]` is the index of the goal.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self._teachers = [Teacher(task=task, light=goal) for goal in task.goals]

    def start(self, episodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """The first goal."""
        return np.zeros(len(episodes), dtype=np.int64)

    def rule(self, sensors: NDArray[np.float64], goal: NDArray[np.int64]) -> NDArray[np.int64]:
        """The index into `TEACHER_RULES` of the rule that fires on the way to each goal, `[B]`."""
        rules = np.stack([teacher.rule(sensors) for teacher in self._teachers])
        return rules[goal, np.arange(len(goal))]

    def step(
        self, readings: NDArray[np.float64], goal: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Commands `[B, 2]` for readings `[B, n]`, and the next goal."""
        pairs = np.array([teacher.pair for teacher in self._teachers])[goal]
        there = np.take_along_axis(readings, pairs, axis=1).mean(1) < AT_LAMP
        goal = np.minimum(goal + there, len(self._teachers) - 1)
        return TEACHER_COMMANDS[self.rule(readings, goal)], goal
