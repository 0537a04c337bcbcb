"""Track the progress of episodes: whether a robot reached the lamp, stayed there, and escaped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.vector_sim import State

DWELL_SECONDS = 2.0
"""A robot succeeds if it stays at the lamp for this time without a break."""


class Tracker:
    """Tracks the episodes of `size` slots; `observe` takes one state per control step.

    A robot succeeds if it is at the lamp (see `sim.vector_sim.TOUCH`) in every state of `dwell_steps` consecutive
    control steps.

    Attributes (each `[size]`):
        clock: index of the last observed state; -1 before the first one.
        first: index of the first state at the lamp; -1 if there is none yet.
        escaped: whether a state was outside the corral.
        success: whether the robot succeeded.
    """

    def __init__(self, size: int, dwell_steps: int) -> None:
        self._dwell_steps = dwell_steps
        self._streak = np.zeros(size, dtype=np.int64)
        self.clock = np.full(size, -1, dtype=np.int64)
        self.first = np.full(size, -1, dtype=np.int64)
        self.escaped = np.zeros(size, dtype=np.bool_)
        self.success = np.zeros(size, dtype=np.bool_)

    def reset(self, slot: int) -> None:
        """Begin a new episode in `slot`."""
        self._streak[slot] = 0
        self.clock[slot] = self.first[slot] = -1
        self.escaped[slot] = self.success[slot] = False

    def observe(self, slots: Sequence[int] | NDArray[np.int64], state: State) -> None:
        """Record the next state of the robots in `slots`."""
        self.clock[slots] += 1
        self._streak[slots] = np.where(state.at_lamp, self._streak[slots] + 1, 0)
        self.first[slots] = np.where(state.at_lamp & (self.first[slots] < 0), self.clock[slots], self.first[slots])
        self.escaped[slots] |= state.outside
        # n control steps are between n + 1 states.
        self.success[slots] = self._streak[slots] > self._dwell_steps
