"""Combine behaviours by the weighted mean of their commands."""

from collections.abc import Sequence

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.composition.base import Policy
from behaviours.options import as_float
from behaviours.recall import Recall


class Blending(Policy):
    """The mean of the behaviours' commands, weighted by softmax(β · familiarity · √k), for k pairs in a program.

    A behaviour that does not know the condition commands something, too: with a small β it is blended in. The speaker
    is the behaviour of the largest weight; similarity, margin and familiarity are its own.

    Args:
        bank: The behaviours to combine.
        beta: β, from 0 (the plain mean) to infinity (`WinnerTakesAll`).

    Source: Saffiotti et al. 1995, "A multivalued logic approach to integrating planning and control".
    """

    def __init__(self, bank: BehaviourBank, beta: float = 10.0) -> None:
        super().__init__(bank, bank.names)
        self.beta = as_float("beta", beta, 0)

    def query(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> Recall:
        """See `Policy.query`."""
        answers = self.answers(conditions)
        weights = (self.beta * self.known(answers)).softmax(-1)
        commands = torch.stack([recall.commands for recall in answers], -1)
        blended = (commands * weights[:, None]).sum(-1)
        # Rounding must not leave the range of the commands.
        blended = blended.clamp(commands.amin(-1), commands.amax(-1))
        return self.spoken(answers, weights.argmax(-1))._replace(commands=blended)
