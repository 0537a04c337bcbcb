"""Track the progress of episodes: which goals a robot reached, whether it stayed at the last one, and escaped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.engine import State

DWELL_SECONDS = 2.0
"""A robot succeeds if it stays at its last lamp for this time without a break."""


class Tracker:
    """Tracks the episodes of `size` slots; `observe` takes one state per control step.

    A robot touches the lamps of its `goals` in their order (see `sim.robot.TOUCH`). It succeeds if it is at the last
    one in every state of `dwell_steps` consecutive control steps.

    Attributes (each `[size]`):
        clock: index of the last observed state; -1 before the first one.
        goal: index of the goal that the robot is to reach next, or to stay at.
        at_goal: whether it touches the lamp of that goal.
        first: index of the first state at the last goal; -1 if there is none yet.
        escaped: whether a state was outside the corral.
        success: whether the robot succeeded.
    """

    def __init__(self, size: int, dwell_steps: int, goals: int = 1) -> None:
        self._dwell_steps, self._last = dwell_steps, goals - 1
        self._streak = np.zeros(size, dtype=np.int64)
        self.clock = np.full(size, -1, dtype=np.int64)
        self.goal = np.zeros(size, dtype=np.int64)
        self.at_goal = np.zeros(size, dtype=np.bool_)
        self.first = np.full(size, -1, dtype=np.int64)
        self.escaped = np.zeros(size, dtype=np.bool_)
        self.success = np.zeros(size, dtype=np.bool_)

    def reset(self, slots: NDArray[np.int64]) -> None:
        """Begin a new episode in `slots`."""
        self._streak[slots] = self.goal[slots] = 0
        self.clock[slots] = self.first[slots] = -1
        self.escaped[slots] = self.success[slots] = self.at_goal[slots] = False

    def observe(self, slots: NDArray[np.int64], state: State) -> None:
        """Record the next state of the robots in `slots`."""
        self.clock[slots] += 1
        goal = self.goal[slots]
        touches = state.at_goals[np.arange(len(goal)), goal]
        at_last = touches & (goal == self._last)
        self.at_goal[slots] = touches
        self.goal[slots] = goal + (touches & ~at_last)
        streak = np.where(at_last, self._streak[slots] + 1, 0)
        first = self.first[slots]
        self._streak[slots] = streak
        self.first[slots] = np.where(at_last & (first < 0), self.clock[slots], first)
        self.escaped[slots] |= state.outside
        # n control steps are between n + 1 states.
        self.success[slots] = streak > self._dwell_steps
