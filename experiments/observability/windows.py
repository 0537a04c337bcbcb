"""Codebooks and controllers for windows of present and past readings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from behaviours import Behaviour, Demonstrations, Schema, Space
from experiments.models.disturbances import Disturbance, Floats, Integers
from experiments.observability.memory import Memory
from torchvsa.encoders import Encoder, History

Answer = Callable[[Floats], Floats]
"""Commands `[B, m]` for windows of readings `[B, w]`."""


class OfWindows(Encoder):
    """A `History` whose sensors are the columns of a window, so that trees and programs learn from the same rows."""

    name = "of_windows"

    def __init__(self, history: History) -> None:
        super().__init__()
        self.history = history
        self.vsa, self.sensors, self.discrete = history.vsa, history.width, history.discrete
        self._own(None)

    def own_layout(self) -> dict[str, Any]:
        """No tensors of its own."""
        return {}

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        return {}

    def config(self) -> dict[str, Any]:
        """See `Part.config`."""
        return {"name": self.name, "history": self.history.config()}

    def cells(self, x: Tensor) -> Tensor:
        """See `Encoder.cells`."""
        return self.history.cells(x)

    def encode(self, cells: Tensor) -> Tensor:
        """See `Encoder.encode`."""
        return self.history.encode(cells)


def over_windows(space: Space, lags: Sequence[int]) -> Space:
    """The same codebooks, for windows of present and past readings."""
    past = [replace(sensor, name=f"{sensor.name}, {lag} ago") for lag in lags for sensor in space.schema.sensors]
    schema = Schema([*space.schema.sensors, *past], space.schema.actuators)
    wide = Space(schema, OfWindows(History(space.encoder, lags)), protection=space.protect, seed=space.seed)
    wide.result_encoder = space.result_encoder
    return wide


class WindowPolicy:
    """A controller that answers windows of disturbed readings.

    Its state is that of the disturbance, and the past readings `[B, p, n]` of each robot.
    """

    def __init__(self, disturbance: Disturbance, answer: Answer, memory: Memory) -> None:
        self.disturbance, self.answer, self.memory = disturbance, answer, memory

    def start(self, episodes: Integers) -> tuple[Any, Tensor]:
        """See `sim.Controller`."""
        return self.disturbance.start(episodes), self.memory.start(len(episodes))

    def step(self, readings: Floats, state: tuple[Any, Tensor]) -> tuple[Floats, tuple[Any, Tensor]]:
        """Commands `[B, m]` for readings `[B, n]`."""
        disturbed, disturbance = self.disturbance.step(readings, state[0])
        seen, past = self.memory.step(disturbed, state[1])
        return self.answer(seen), (disturbance, past)


class ProgramAnswer:
    """The answer of a program; where no sensor is observed, the command that was demonstrated most often."""

    def __init__(self, behaviour: Behaviour, train: Demonstrations) -> None:
        self.behaviour = behaviour
        commands, counts = train.commands.unique(dim=0, return_counts=True)
        self.usual = commands[int(counts.argmax())]

    @torch.no_grad()
    def __call__(self, seen: Floats) -> Floats:
        """Commands `[B, m]`."""
        answers = torch.cat([self.behaviour(block).commands for block in torch.from_numpy(seen).split(2048)])
        return torch.where(answers.isnan(), self.usual, answers).numpy()
