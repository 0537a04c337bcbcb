"""The interface of everything that drives a robot: readings in, a `Recall` out, step by step."""

from abc import ABC, abstractmethod
from collections.abc import Sized
from typing import Any

from jaxtyping import Shaped
from torch import Tensor, nn

from behaviours.recall import Recall, over_unique_rows
from behaviours.space import Space


class Controller(nn.Module, ABC):
    """The base class of behaviours, and of policies that combine them.

    Called with readings `[B, n]`, it answers each row independently. If conditions contain past readings
    (`torchvsa.encoders.History`), or if a policy has a state, `start` and `step` pass that state explicitly, as with a
    PyTorch RNN cell:

        state = controller.start(episodes)
        recall, state = controller.step(readings, state)

    The state has one row per robot; robots never influence each other. Without a memory it is empty.
    """

    space: Space

    def forward(self, readings: Any) -> Recall:
        """Commands `[B, m]` for readings `[B, n]`, with similarity, margin and familiarity (see `Recall`).

        Raises `ValueError` that names sensor, row and range for invalid readings. A compiled or exported graph takes
        readings as a tensor and cannot raise; there, readings out of range are clipped.
        """
        return self.answer(self.space.cells(readings))

    def start(self, episodes: Sized) -> Any:
        """The state before the first step of these episodes, one per robot."""
        return self.space.start(len(episodes))

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        """The answer to the readings `[B, n]` of the next step, and the state after it."""
        cells, state = self.space.step(readings, state)
        return self.answer(cells), state

    def answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        """The answer to cells as `Space.cells` returns them; commands are NaN where no sensor was observed."""
        return over_unique_rows(self._answer, cells).mask_unobserved((cells < 0).all(-1))

    @abstractmethod
    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        """The answer to cells; rows in which no sensor was observed are masked afterwards."""
