"""Combine behaviours by the weighted sum of their programs."""

from collections.abc import Mapping, Sequence

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.algebra import stack_programs
from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.composition.base import Policy
from behaviours.memory import require_levels
from behaviours.recall import Recall, familiarity


class Bundle(Policy):
    """The weighted sum `Σ wᵢ pᵢ` of all programs of a bank, used like a single program.

    Recall is linear up to the clean-up, so that this is voting: the score of a result is the weighted sum of the scores
    that the behaviours give it. This holds for the raw sum, but not for a clipped one. The speaker is the behaviour
    that contributes most to the score of the recalled result.

    Integer programs with whole weights are summed exactly: in int32, or in float64 if int32 is too small.

    Args:
        bank: The behaviours to combine.
        weights: Weights by name; 1 for behaviours that are not named. A behaviour of weight 0 is left out, with its
            known conditions and results, but stays in `names`.

    Raises:
        ValueError: For behaviours that use different sensors, for smooth ones (add them instead), for weights that are
            not finite or are all 0, and for sums with elements that could exceed 2^53, up to which float64 represents
            all integers, or that are so small that their squares underflow.
    """

    _weights: Tensor

    def __init__(self, bank: BehaviourBank, weights: Mapping[str, float] | None = None) -> None:
        super().__init__(bank, bank.names)
        require_levels("Bundle", self.parts)
        self.weights = self.weights_of(weights)
        """One weight per name."""
        # A buffer is on the device of the programs before it is needed; copying a list there waits for the device.
        row = torch.tensor(self.weights, dtype=torch.float64, device=self.space.device)
        self.register_buffer("_weights", row, persistent=False)
        self.behaviour = Behaviour.sum(self.parts, self.weights)
        """The sum as a behaviour."""

    @property
    def program(self) -> Shaped[Tensor, "d"]:
        """The weighted sum of the programs."""
        return self.behaviour.program

    def query(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> Recall:
        """See `Policy.query`."""
        whole, condition = self.behaviour, conditions[0]
        readout = whole.readout()
        match = readout.match(condition)
        # The score of a result is the weighted sum of its scores for each behaviour.
        parts = readout.of(stack_programs([part.program for part in self.parts]))(condition)
        winner = match.index[:, None, None].expand(-1, len(self.weights), 1)
        shares = (self._weights * parts.gather(-1, winner)[..., 0]).masked_fill(self._weights == 0, -torch.inf)
        familiar = familiarity(condition, whole.known)
        return Recall(whole.memory.commands[match.index], match.similarity, match.margin, familiar, shares.argmax(-1))
