"""Bundling: the weighted sum of the programs is a program."""

from collections.abc import Mapping

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.algebra import stacked
from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.composition.base import Policy
from behaviours.recall import Recall


class Bundle(Policy):
    """One hypervector for all: `Σ wᵢ pᵢ`, asked like any single program.

    Because recall is linear until the clean-up, this is voting: each result's score is the weighted sum of
    the scores that the behaviours give it. That holds for the raw sum; clipping it would break it. The
    speaker is the behaviour that contributes most to the winning result.

    `weights` default to 1 for every behaviour. A behaviour of weight 0 is left out, with its known conditions and its
    results; it keeps its place in `names`. Integer programs with whole weights are summed exactly: in int32, or in
    float64 where that is too small.

    Raises `ValueError` for weights that are no finite numbers or all 0, and for sums whose elements could be larger
    than 2^53, up to which float64 holds all integers, or so small that their squares are lost.
    """

    def __init__(self, bank: BehaviourBank, weights: Mapping[str, float] | None = None) -> None:
        super().__init__(bank, bank.names)
        self.weights = self.per_behaviour(weights, [1.0] * len(self.names), "weights")
        """One per name; plain ints if all of them are whole."""
        if all(weight.is_integer() for weight in self.weights):
            self.weights = [int(weight) for weight in self.weights]
        if not any(self.weights):
            raise ValueError(f"at least one weight must differ from 0; got 0 for each of {', '.join(self.names)}")
        self.behaviour = Behaviour.sum(self.parts, self.weights)
        """The bundle as a behaviour of its own: the same form as each of its parts."""

    @property
    def program(self) -> Shaped[Tensor, "d"]:
        """The weighted sum of the programs."""
        return self.behaviour.program

    def query(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """See `Policy.query`."""
        scores = self.behaviour.readout()(conditions)
        # The score of the sum is the weighted sum of the scores that the behaviours give.
        parts = self.behaviour.readout().of(stacked([part.program for part in self.parts]))(conditions)
        weights = torch.tensor(self.weights, dtype=torch.float64, device=scores.device)
        winner = scores.argmax(-1)[:, None, None].expand(-1, len(weights), 1)
        shares = (weights * parts.gather(-1, winner)[..., 0]).masked_fill(weights == 0, -torch.inf)
        return self.behaviour.query(conditions)._replace(speaker=shares.argmax(-1))
