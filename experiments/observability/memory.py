"""What learners see of the teacher's runs: disturbed readings, with or without a memory of past ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64
from numpy.typing import NDArray
from torch import Tensor

import sim
from behaviours import Demonstrations
from experiments.models.disturbances import Disturbance, Floats, Integers, disturb_in_turns
from experiments.tasks.corral import shown_in
from torchvsa.encoders.history import no_past, window, windows


@dataclass(frozen=True)
class Memory:
    """Which readings a learner sees: the present ones and those `lags` steps ago.

    With `hold`, the last reading that arrived replaces one that is missing.
    """

    lags: tuple[int, ...] = ()
    hold: bool = False

    def start(self, robots: int) -> Tensor:
        """The past of robots that have seen nothing yet, `[robots, past, n]`."""
        return no_past(robots, len(sim.SENSORS), self.lags, self.hold)

    def step(self, readings: Floats, past: Tensor) -> tuple[Floats, Tensor]:
        """Windows `[B, w]` for readings `[B, n]`, and the past of the next step."""
        seen, past = window(torch.from_numpy(readings), past, self.lags, self.hold)
        return seen.numpy(), past

    def __str__(self) -> str:
        steps = "step" if self.lags == (1,) else "steps"
        past = f"{', '.join(map(str, self.lags))} {steps} ago" if self.lags else "no past"
        return f"{past}, gaps held" if self.hold else past


@dataclass(frozen=True)
class TeacherRuns:
    """Recorded runs of the teacher: true readings `[N, n]`, its commands `[N, m]`, episodes and steps `[N]`.

    `moving` `[N]`: before the lamp was reached. A robot at rest repeats one condition and would flatter every learner,
    so only these steps are compared; what it does at the lamp is learned all the same.
    """

    readings: Floats
    commands: Floats
    episodes: Integers
    steps: Integers
    moving: NDArray[np.bool_]

    @classmethod
    def of(cls, rollout: sim.Rollout) -> TeacherRuns:
        """All control steps of a recorded rollout."""
        steps, moving = shown_in(rollout)
        return cls(
            steps.sensors.numpy(), steps.commands.numpy(), steps.episodes.numpy(), rollout.trajectory.step, moving
        )

    def windows(self, disturbances: Sequence[Disturbance], memory: Memory) -> Float64[Tensor, "N w"]:
        """What a learner with this memory sees of them; the disturbances take turns, one per episode."""
        disturbed = disturb_in_turns(disturbances, self.readings, self.episodes)
        return windows(torch.from_numpy(disturbed), torch.from_numpy(self.episodes), memory.lags, memory.hold)

    def demonstrations(self, disturbances: Sequence[Disturbance], memory: Memory) -> Demonstrations:
        """The samples to learn from: those with at least one reading. Raises `ValueError` if there is none."""
        seen = self.windows(disturbances, memory)
        observed = ~seen.isnan().all(-1)
        if not observed.any():
            raise ValueError("no sensor was observed in any demonstration; choose weaker disturbances")
        return Demonstrations(seen, self.commands, self.episodes).where(observed)
