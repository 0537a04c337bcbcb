"""Combine behaviours by priority: the first one that knows the condition answers."""

from collections.abc import Mapping, Sequence
from typing import Literal

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.composition.base import THRESHOLDS, Policy
from behaviours.recall import Recall


class Priority(Policy):
    """Subsumption: the first behaviour in `order` that knows the condition answers.

    It knows the condition if the condition is familiar, or if its answer is clear: if `familiarity`, or `similarity`,
    is above a threshold. If there is none that does, the one that comes nearest to its threshold answers.

    By default a threshold of familiarity is what nearly all of the behaviour's own conditions reach
    (`Behaviour.threshold`); where that is unknown, as for sums, it is half of 1/√k, the familiarity of one of k
    unrelated conditions. A threshold of similarity is half of what nearly all of its own conditions reach
    (`Behaviour.least_similarity`), or 0. Similarity suits behaviours that are silent where others know
    (`BehaviourBank.learn_apart`): in those conditions it is about 0, whatever the codebooks.

    Args:
        bank: The behaviours to combine.
        order: Names, from the highest priority to the lowest; by default the order in which they were learned.
        thresholds: Thresholds by name.
        by: `"familiarity"` or `"similarity"`.

    Source: Brooks 1986, "A robust layered control system for a mobile robot".
    """

    _thresholds: Tensor

    def __init__(
        self,
        bank: BehaviourBank,
        order: Sequence[str] | None = None,
        thresholds: Mapping[str, float] | None = None,
        by: Literal["familiarity", "similarity"] = "familiarity",
    ) -> None:
        if by not in THRESHOLDS:
            raise ValueError(f"by={by!r}: expected one of {', '.join(map(repr, THRESHOLDS))}")
        if isinstance(order, str):
            raise TypeError(f"order is a list of names, the highest priority first; write [{order!r}] for {order!r}")
        super().__init__(bank, bank.names if order is None else list(order))
        self.by = by
        defaults = [THRESHOLDS[by](part) for part in self.parts]
        self.thresholds = self.per_behaviour(thresholds, defaults, "thresholds")
        # A buffer is on the device of the programs before it is needed; copying a list there waits for the device.
        column = torch.tensor(self.thresholds, device=self.space.device)[:, None]
        self.register_buffer("_thresholds", column, persistent=False)

    def query(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> Recall:
        """See `Policy.query`."""
        answers = self.answers(conditions)
        above = torch.stack([getattr(recall, self.by) for recall in answers]) - self._thresholds
        known = above >= 0
        speaker = torch.where(known.any(0), known.to(torch.int8).argmax(0), above.argmax(0))
        return self.spoken(answers, speaker)
