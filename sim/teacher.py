"""The teacher: five if-else rules on thresholded readings.

Source: the corral-escape rules that Neubert et al. 2016 print in section IV, after Levy et al. 2014.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.checks import real_rows
from sim.sensors import LIGHT_MAX, SENSORS

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
    """The rules as a function: `teacher(sensors [B, 3]) -> commands [B, 2]`, each command exactly -1 or +1.

    Light is sensed if its reading is below `light_below`, an obstacle if the distance is below `obstacle_below`.
    """

    def __init__(self, light_below: float = LIGHT_MAX, obstacle_below: float = OBSTACLE) -> None:
        self.light_below = light_below
        self.obstacle_below = obstacle_below

    def rule(self, sensors: NDArray[np.float64]) -> NDArray[np.int64]:
        """The index into `TEACHER_RULES` of the rule that fires, `[B]`.

        Raises `ValueError` unless `sensors` is `[B, 3]`.
        """
        sensors = real_rows("sensors", sensors)
        if sensors.ndim != 2 or sensors.shape[1] != len(SENSORS):
            names = ", ".join(sensor.name for sensor in SENSORS)
            raise ValueError(f"sensors have shape {sensors.shape}; expected [B, {len(SENSORS)}] ({names})")
        left, right = (sensors[:, :2] < self.light_below).T
        obstacle = sensors[:, 2] < self.obstacle_below
        dark = np.where(obstacle, 3, 4)
        return np.where(left, np.where(right, 0, 1), np.where(right, 2, dark)).astype(np.int64)

    def __call__(self, sensors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Commands `[B, 2]` for `sensors` `[B, 3]`."""
        return TEACHER_COMMANDS[self.rule(sensors)]
