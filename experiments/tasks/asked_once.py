"""Drive with the answers of behaviours or policies, each condition asked once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from behaviours import Behaviour, Policy, Recall, Silence
from behaviours.controller import Controller
from behaviours.frozen import FrozenBehaviour

MOST_CELLS = 2**22
"""The most conditions, of all controllers together, whose answers can be looked up by number; 16 MiB."""


class AskedOnce:
    """Answers as `controller` does, which is asked once about each condition that any robot meets.

    A robot in the corral meets a few hundred conditions, again and again. What was answered is kept here, as long as
    this object lives; later changes of the controller do not affect it.

    Args:
        controller: A controller for which `possible` holds.
    """

    def __init__(self, controller: Controller) -> None:
        self._each = EachAskedOnce([controller])

    @staticmethod
    def possible(controller: object) -> bool:
        """Whether a controller has no memory, and few enough conditions."""
        if not isinstance(controller, Behaviour | FrozenBehaviour | Policy | Silence):
            return False
        encoder, kind = controller.space.encoder, type(controller)
        plain = kind.start is Controller.start and kind.forward in (Controller.forward, FrozenBehaviour.forward)
        binned = encoder.discrete and hasattr(encoder, "bins") and encoder.width == encoder.sensors
        return plain and binned and math.prod(_sizes(controller)) <= MOST_CELLS

    def __call__(self, readings: NDArray[np.float64]) -> Recall:
        """The answer to readings `[B, n]`."""
        return self._each.step(readings, np.zeros(len(readings), dtype=np.int64))[0]


class EachAskedOnce:
    """Several controllers over equal sensors and bins; episode e is driven by controller e mod their number.

    As with `AskedOnce`, each controller is asked once about each condition that any of its robots meets.
    """

    def __init__(self, controllers: Sequence[Controller]) -> None:
        self.controllers = list(controllers)
        self._sizes = (len(self.controllers), *_sizes(self.controllers[0]))
        self._found = np.full(math.prod(self._sizes), -1, dtype=np.int32)
        self._answers: Recall | None = None

    def start(self, episodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """The controller of each episode."""
        return episodes % len(self.controllers)

    def step(self, readings: NDArray[np.float64], which: NDArray[np.int64]) -> tuple[Recall, NDArray[np.int64]]:
        """The answers to readings `[B, n]` of the controllers `which` `[B]`."""
        cells = self.controllers[0].space.encoder.cells(self.controllers[0].space.schema.normalise(readings))
        # The last number of each sensor is for a reading that was not observed, whose cell is -1.
        place = (which, *cells.numpy().T)
        number = np.asarray(np.ravel_multi_index(place, self._sizes, mode="wrap"))
        for index in np.unique(which[self._found[number] < 0]):
            own = np.flatnonzero((which == index) & (self._found[number] < 0))
            new, first = np.unique(number[own], return_index=True)
            controller = self.controllers[index]
            asked = cells[torch.from_numpy(own[first])]
            space = controller.space
            self._found[new] = self._keep(controller.answer(space.seen(asked)))
        assert self._answers is not None
        return self._answers.rows(torch.from_numpy(self._found[number])), which

    def alone(self, number: int) -> Callable[[NDArray[np.float64]], Recall]:
        """One of the controllers, as a function of readings."""
        return lambda readings: self.step(readings, np.full(len(readings), number))[0]

    def _keep(self, answer: Recall) -> NDArray[np.int64]:
        """Keep these answers; returns their numbers."""
        before = self._answers
        self._answers = answer if before is None else before.joined(answer)
        total = len(self._answers.commands)
        return np.arange(total - len(answer.commands), total)


def _sizes(controller: Any) -> tuple[int, ...]:
    encoder = controller.space.encoder
    return (encoder.bins + 1,) * encoder.sensors
