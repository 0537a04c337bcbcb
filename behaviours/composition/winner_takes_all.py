"""Combine behaviours by familiarity: the one that knows the condition best answers."""

from collections.abc import Sequence

from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.composition.base import Policy
from behaviours.recall import Recall


class WinnerTakesAll(Policy):
    """The behaviour with the largest familiarity times √k answers, for k pairs in its program.

    Without the root, behaviours of few pairs would win: each of k unrelated conditions has a familiarity of about 1/√k.

    Args:
        bank: The behaviours to combine.

    Source: Maes 1989, "How to do the right thing", whose behaviours compete by activation.
    """

    def __init__(self, bank: BehaviourBank) -> None:
        super().__init__(bank, bank.names)

    def query(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> Recall:
        """See `Policy.query`."""
        answers = self.answers(conditions)
        return self.spoken(answers, self.known(answers).argmax(-1))
