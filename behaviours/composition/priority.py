"""Priority: the first behaviour that knows the condition speaks."""

from collections.abc import Mapping, Sequence

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.composition.base import Policy
from behaviours.recall import Recall


class Priority(Policy):
    """Subsumption: ask the first behaviour in `order` whose familiarity with the condition passes its threshold.

    Where none does, the most familiar one speaks. The similarity of a member to the sum of k unrelated
    conditions is about 1/√k, so thresholds default to half of that.

    Source: Brooks 1986, "A robust layered control system for a mobile robot".
    """

    def __init__(
        self,
        bank: BehaviourBank,
        order: Sequence[str] | None = None,
        thresholds: Mapping[str, float] | None = None,
    ) -> None:
        if isinstance(order, str):
            raise TypeError(f"order is a list of names, the first to be asked first; write [{order!r}] for {order!r}")
        super().__init__(bank, bank.names if order is None else list(order))
        calibrated = [0.5 / max(part.report.pairs, 1) ** 0.5 for part in self.parts]
        self.thresholds = self.per_behaviour(thresholds, calibrated, "thresholds")

    def query(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """See `Policy.query`."""
        answers = [part.query(conditions) for part in self.parts]
        familiarity = torch.stack([recall.familiarity for recall in answers])
        knows = familiarity > torch.tensor(self.thresholds, device=familiarity.device)[:, None]
        speaker = torch.where(knows.any(0), knows.to(torch.int8).argmax(0), familiarity.argmax(0))
        rows = torch.arange(conditions.shape[0], device=speaker.device)

        def spoken(field: str) -> Tensor:
            return torch.stack([getattr(recall, field) for recall in answers])[speaker, rows]

        return Recall(spoken("commands"), spoken("similarity"), spoken("margin"), spoken("familiarity"), speaker)
