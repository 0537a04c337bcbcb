"""Drive with the answers of a behaviour or policy, each condition asked once."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from behaviours import Behaviour, Policy, Recall
from behaviours.controller import Controller
from behaviours.frozen import FrozenBehaviour

MOST_CELLS = 2**22
"""The most conditions whose answers can be looked up by number; 16 MiB."""


class AskedOnce:
    """Answers as `controller` does, which is asked once about each condition that any robot meets.

    A robot in the corral meets a few hundred conditions, again and again. What was answered is kept here, as long as
    this object lives; later changes of the controller do not affect it.

    Args:
        controller: A controller for which `possible` holds.
    """

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self._sizes = _sizes(controller)
        self._found = np.full(math.prod(self._sizes), -1, dtype=np.int32)
        self._answers: Recall | None = None

    @staticmethod
    def possible(controller: object) -> bool:
        """Whether a controller has no memory, and few enough conditions."""
        if not isinstance(controller, Behaviour | FrozenBehaviour | Policy):
            return False
        encoder, kind = controller.space.encoder, type(controller)
        plain = kind.start is Controller.start and kind.forward in (Controller.forward, FrozenBehaviour.forward)
        binned = encoder.discrete and hasattr(encoder, "bins") and encoder.width == encoder.sensors
        return plain and binned and math.prod(_sizes(controller)) <= MOST_CELLS

    def __call__(self, readings: NDArray[np.float64]) -> Recall:
        """The answer to readings `[B, n]`."""
        cells = self.controller.space.cells(readings)
        # The last number of each sensor is for a reading that was not observed, whose cell is -1.
        number = np.asarray(np.ravel_multi_index(tuple(cells.numpy().T), self._sizes, mode="wrap"))
        row = self._found[number]
        if (row < 0).any():
            new, first = np.unique(number[row < 0], return_index=True)
            asked = cells[torch.from_numpy(np.flatnonzero(row < 0)[first])]
            self._found[new] = self._keep(self.controller.answer(asked))
            row = self._found[number]
        assert self._answers is not None
        return self._answers.rows(torch.from_numpy(row))

    def _keep(self, answer: Recall) -> NDArray[np.int64]:
        """Keep these answers; returns their numbers."""
        before = self._answers
        self._answers = answer if before is None else before.joined(answer)
        total = len(self._answers.commands)
        return np.arange(total - len(answer.commands), total)


def _sizes(controller: Any) -> tuple[int, ...]:
    encoder = controller.space.encoder
    return (encoder.bins + 1,) * encoder.sensors
