"""The teacher: five if-else rules on thresholded readings.

Source: the corral-escape rules that Neubert et al. 2016 print in section IV, after Levy et al. 2014.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.checks import real_rows
from sim.sensors import LIGHT_MAX
from sim.task import Task

OBSTACLE = 0.22
"""An obstacle is sensed below this distance, m. It is no edge of 16, 20, 24, 32, 48 or 64 equal bins over the sensor's
range: a learner with equal bins does not get the threshold for free."""

TEACHER_RULES = ("stay_in_light", "turn_left_to_light", "turn_right_to_light", "avoid_obstacle", "cruise")
"""Names of the rules, in order. The first one whose condition holds fires."""

BEHAVIOURS: dict[str, tuple[int, ...]] = {"seek_light": (0, 1, 2), "avoid": (3,), "cruise": (4,)}
"""Groups of rules that form a behaviour: name -> indices into `TEACHER_RULES`."""

TEACHER_COMMANDS: NDArray[np.float64] = np.array([[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
"""The command of each rule `[5, 2]`: left and right wheel."""
TEACHER_COMMANDS.flags.writeable = False


class Teacher:
    """The rules as a function: `teacher(sensors [B, n]) -> commands [B, 2]`.

    Args:
        light_below: light is sensed if its reading is below this, m.
        obstacle_below: an obstacle is sensed if the distance is below this, m.
        task: says what the columns of the readings are.
        light: the colour of the light to go to, by default the first.
        avoid: the command for an obstacle ahead. Turning on the spot is the paper's; `(-0.5, 1.0)`, a turn that moves
            on, leaves more corrals (see docs/world.md).
    """

    def __init__(
        self,
        light_below: float = LIGHT_MAX,
        obstacle_below: float = OBSTACLE,
        task: Task = Task(),
        light: str | None = None,
        avoid: tuple[float, float] = (-1.0, 1.0),
    ) -> None:
        self.light_below = light_below
        self.obstacle_below = obstacle_below
        self.task = task
        self.pair = task.pair(task.lights[0] if light is None else light)
        self.commands = TEACHER_COMMANDS.copy()
        self.commands[TEACHER_RULES.index("avoid_obstacle")] = avoid

    def rule(self, sensors: NDArray[np.float64]) -> NDArray[np.int64]:
        """The index into `TEACHER_RULES` of the rule that fires, `[B]`.

        Raises `ValueError` unless `sensors` is `[B, n]`.
        """
        left, right, obstacle = sensed(sensors, self.task, self.pair, self.light_below, self.obstacle_below)
        dark = np.where(obstacle, 3, 4)
        return np.where(left, np.where(right, 0, 1), np.where(right, 2, dark)).astype(np.int64)

    def __call__(self, sensors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Commands `[B, 2]` for `sensors` `[B, n]`."""
        return self.commands[self.rule(sensors)]


def sensed(
    sensors: NDArray[np.float64],
    task: Task,
    pair: tuple[int, int],
    light_below: float = LIGHT_MAX,
    obstacle_below: float = OBSTACLE,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether light is sensed on the left and on the right, and an obstacle ahead, each `[B]`.

    Raises `ValueError` unless `sensors` is `[B, n]`.
    """
    sensors = real_rows("sensors", sensors)
    if sensors.ndim != 2 or sensors.shape[1] != len(task.sensors):
        names = ", ".join(sensor.name for sensor in task.sensors)
        raise ValueError(f"sensors have shape {sensors.shape}; expected [B, {len(task.sensors)}] ({names})")
    left, right = (sensors[:, column] < light_below for column in pair)
    return left, right, sensors[:, -1] < obstacle_below
