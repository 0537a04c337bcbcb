"""What counts in an episode: reaching the lamp, staying there, escaping, touching walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.vector_sim import State

DWELL_SECONDS = 2.0
"""How long a robot must stay at the lamp, without a break, to succeed."""


class Tracker:
    """Follows the episodes of `size` slots, one observed state a control step.

    Success: at the lamp (see `sim.vector_sim.TOUCH`) in every state of `dwell_steps` control steps in a row.

    Attributes (each `[size]`):
        clock: index of the state observed last; -1 before the first.
        first: index of the first state at the lamp; -1 if there was none yet.
        escaped: some state was outside the corral.
        success: the dwell time is over.
    """

    def __init__(self, size: int, dwell_steps: int) -> None:
        self._dwell_steps = dwell_steps
        self._streak = np.zeros(size, dtype=np.int64)
        self.clock = np.full(size, -1, dtype=np.int64)
        self.first = np.full(size, -1, dtype=np.int64)
        self.escaped = np.zeros(size, dtype=np.bool_)
        self.success = np.zeros(size, dtype=np.bool_)

    def reset(self, slot: int) -> None:
        """Forget the episode in `slot`."""
        self._streak[slot] = 0
        self.clock[slot] = self.first[slot] = -1
        self.escaped[slot] = self.success[slot] = False

    def observe(self, slots: Sequence[int] | NDArray[np.int64], state: State) -> None:
        """Take in the next state of the robots in `slots`."""
        self.clock[slots] += 1
        self._streak[slots] = np.where(state.at_lamp, self._streak[slots] + 1, 0)
        self.first[slots] = np.where(state.at_lamp & (self.first[slots] < 0), self.clock[slots], self.first[slots])
        self.escaped[slots] |= state.outside
        # A dwell of n control steps lies between n + 1 states.
        self.success[slots] = self._streak[slots] > self._dwell_steps
