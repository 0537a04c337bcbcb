"""No answer where nobody is sure."""

from collections.abc import Sequence
from typing import Any

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.controller import Controller
from behaviours.options import as_float
from behaviours.recall import Recall


class Silence(Controller):
    """Answer as `controller` does, unless its familiarity or similarity is too low; then be silent.

    A silent row has the speaker -1 and the commands `fallback`; similarity, margin and familiarity stay as they are.

        Silence(bank["seek"], familiarity=bank["seek"].threshold, fallback=[0, 0])   # stands still in the unknown

    Args:
        controller: A behaviour or policy without memory.
        familiarity: The least familiarity with which it speaks.
        similarity: The least similarity with which it speaks.
        fallback: Commands for silent rows, one per actuator; by default NaN, which a simulator refuses.

    Raises:
        ValueError: For a controller with a state, for thresholds that are not numbers, and for a fallback that is not
            one valid command per actuator.
    """

    _fallback: Tensor

    def __init__(
        self,
        controller: Controller,
        familiarity: float = -1.0,
        similarity: float = -1.0,
        fallback: Sequence[float] | None = None,
    ) -> None:
        super().__init__()
        if type(controller).start is not Controller.start:
            raise ValueError(f"{type(controller).__name__} has a memory, which Silence would lose; wrap its behaviours")
        self.controller, self.space = controller, controller.space
        self.familiarity = as_float("familiarity", familiarity)
        self.similarity = as_float("similarity", similarity)
        row: Any = [torch.nan] * len(self.space.schema.actuators) if fallback is None else list(fallback)
        if fallback is not None:
            self.space.schema.command_levels([row])
        commands = torch.tensor(row, dtype=torch.float64, device=self.space.device)
        self.register_buffer("_fallback", commands, persistent=False)

    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        recall = self.controller.answer(cells)
        silent = (recall.familiarity < self.familiarity) | (recall.similarity < self.similarity)
        speaker = torch.zeros_like(silent, dtype=torch.int64) if recall.speaker is None else recall.speaker
        return recall._replace(
            commands=torch.where(silent[:, None], self._fallback, recall.commands),
            speaker=speaker.masked_fill(silent, -1),
        )
