"""Combine behaviours by the weighted sum of what they recall, before the clean-up."""

from collections.abc import Mapping, Sequence

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.composition.base import Policy
from behaviours.options import as_bool
from behaviours.recall import Recall
from torchvsa.memory import best


class MotorSchema(Policy):
    """The noisy results of all behaviours are added, weighted, and cleaned up once: Σ wᵢ aᵢ unbind(pᵢ, cᵢ).

    aᵢ is the familiarity of behaviour i with its condition cᵢ, so that one who does not know it is hardly heard. Unlike
    in a `Bundle`, behaviours may use different sensors. The speaker is the behaviour that contributes most to the score
    of the recalled result; `similarity` is the mean of the behaviours' cosines with it, weighted by the length of what
    each adds; `familiarity` is the speaker's.

    Args:
        bank: The behaviours to combine.
        weights: Weights wᵢ by name; 1 for behaviours that are not named.
        familiarity: Whether to weigh by familiarity; without it, this is the sum of scores, as in a `Bundle`.

    Source: Arkin 1989, "Motor schema-based mobile robot navigation".
    """

    _weights: Tensor

    def __init__(
        self, bank: BehaviourBank, weights: Mapping[str, float] | None = None, familiarity: bool = True
    ) -> None:
        super().__init__(bank, bank.names)
        self.weights = self.weights_of(weights)
        """One weight per name."""
        self.familiarity = as_bool("familiarity", familiarity)
        row = torch.tensor(self.weights, dtype=torch.float64, device=self.space.device)
        self.register_buffer("_weights", row, persistent=False)
        self.memory = self.joint_memory()

    def query(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> Recall:
        """See `Policy.query`."""
        items = self.memory.current_items()
        answers = self.answers(conditions)
        readouts = [self.space.vsa.readout(part.program, items) for part in self.parts]
        pairs = list(zip(readouts, conditions, strict=True))
        scores = torch.stack([readout(condition) for readout, condition in pairs], 1)
        lengths = torch.stack([readout.noise(condition) for readout, condition in pairs], 1)
        loudness = self._weights.expand(scores.shape[0], -1)
        if self.familiarity:
            loudness = loudness * torch.stack([recall.familiarity.double() for recall in answers], -1)
        shares = loudness[..., None] * scores
        # No sum of noisy results is longer than their lengths together.
        match = best(shares.sum(1), (loudness.abs() * lengths).sum(-1))
        winner = match.index[:, None, None].expand(-1, shares.shape[1], 1)
        spoken = self.spoken(answers, shares.gather(-1, winner)[..., 0].argmax(-1))
        return spoken._replace(
            commands=self.memory.commands[match.index], similarity=match.similarity, margin=match.margin
        )
