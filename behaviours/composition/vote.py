"""Combine behaviours by the majority of their commands."""

from collections.abc import Sequence

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.composition.base import Policy
from behaviours.recall import Recall


class Vote(Policy):
    """The commands that most behaviours give; ties go to the behaviour that knows the condition best.

    Each behaviour has one vote, also where it knows nothing: a reference point rather than a recommendation. The
    speaker is the behaviour that knows the condition best (`Policy.known`) among those of the majority.

    Args:
        bank: The behaviours to combine.
    """

    def __init__(self, bank: BehaviourBank) -> None:
        super().__init__(bank, bank.names)

    def query(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> Recall:
        """See `Policy.query`."""
        answers = self.answers(conditions)
        commands = torch.stack([recall.commands for recall in answers], 1)
        votes = (commands[:, :, None] == commands[:, None]).all(-1).sum(-1)
        majority = votes == votes.amax(-1, keepdim=True)
        return self.spoken(answers, self.known(answers).masked_fill(~majority, -torch.inf).argmax(-1))
