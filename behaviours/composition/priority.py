"""Combine behaviours by priority: the first one that knows the condition answers."""

from collections.abc import Mapping, Sequence

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.composition.base import Policy, threshold_of
from behaviours.recall import Recall


class Priority(Policy):
    """Subsumption: the first behaviour in `order` whose familiarity is above its threshold answers.

    If there is none, the one that comes nearest to its threshold does. By default a threshold is what nearly all of the
    behaviour's own conditions reach (`Behaviour.threshold`); where that is unknown, as for sums, it is half of 1/√k,
    the familiarity of one of k unrelated conditions.

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
        defaults = [threshold_of(part) for part in self.parts]
        self.thresholds = self.per_behaviour(thresholds, defaults, "thresholds")
        # A buffer is on the device of the programs before it is needed; copying a list there waits for the device.
        column = torch.tensor(self.thresholds, device=self.space.device)[:, None]
        self.register_buffer("_thresholds", column, persistent=False)

    def query(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> Recall:
        """See `Policy.query`."""
        answers = self.answers(conditions)
        above = torch.stack([recall.familiarity for recall in answers]) - self._thresholds
        known = above >= 0
        speaker = torch.where(known.any(0), known.to(torch.int8).argmax(0), above.argmax(0))
        return self.spoken(answers, speaker)
