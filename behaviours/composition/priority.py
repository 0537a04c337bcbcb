"""Combine behaviours by priority: the first one that knows the condition answers."""

from collections.abc import Mapping, Sequence

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.composition.base import Policy
from behaviours.recall import Recall


class Priority(Policy):
    """Subsumption: the first behaviour in `order` whose familiarity is above its threshold answers.

    If there is none, the behaviour with the highest familiarity answers. The similarity of a known condition to the sum
    of k unrelated conditions is about 1/√k, so thresholds default to half of that.

    Args:
        bank: The behaviours to combine.
        order: Names, from the highest priority to the lowest; by default the order in which they were learned.
        thresholds: Thresholds by name.

    Source: Brooks 1986, "A robust layered control system for a mobile robot".
    """

    _thresholds: Tensor

    def __init__(
        self,
        bank: BehaviourBank,
        order: Sequence[str] | None = None,
        thresholds: Mapping[str, float] | None = None,
    ) -> None:
        if isinstance(order, str):
            raise TypeError(f"order is a list of names, the highest priority first; write [{order!r}] for {order!r}")
        super().__init__(bank, bank.names if order is None else list(order))
        defaults = [0.5 / max(part.report.pairs, 1) ** 0.5 for part in self.parts]
        self.thresholds = self.per_behaviour(thresholds, defaults, "thresholds")
        # A buffer is on the device of the programs before it is needed; copying a list there waits for the device.
        column = torch.tensor(self.thresholds, device=self.space.device)[:, None]
        self.register_buffer("_thresholds", column, persistent=False)

    def query(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """The answer to encoded and protected conditions, see `Policy.query`."""
        answers = [part.query(conditions) for part in self.parts]
        familiarity = torch.stack([recall.familiarity for recall in answers])
        known = familiarity > self._thresholds
        speaker = torch.where(known.any(0), known.to(torch.int8).argmax(0), familiarity.argmax(0))
        rows = torch.arange(conditions.shape[0], device=speaker.device)

        def of_speaker(field: str) -> Tensor:
            return torch.stack([getattr(recall, field) for recall in answers])[speaker, rows]

        return Recall(
            of_speaker("commands"), of_speaker("similarity"), of_speaker("margin"), of_speaker("familiarity"), speaker
        )
