"""Bundling: the weighted sum of the programs is a program."""

from collections.abc import Mapping, Sequence
from functools import reduce

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.composition.base import Policy
from behaviours.ordered import distinct_rows
from behaviours.recall import Recall
from behaviours.report import LearningReport
from torchvsa import VSA
from torchvsa.exact import is_integer, signed


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
        parts = [part for part, weight in zip(self.parts, self.weights, strict=True) if weight]
        if not parts:
            raise ValueError(f"at least one weight must differ from 0; got 0 for each of {', '.join(self.names)}")
        report = LearningReport("bundle", sum(p.report.samples for p in parts), sum(p.report.new for p in parts))
        self.behaviour = Behaviour(
            self.space,
            weighted_sum(self.space.vsa, [weight for weight in self.weights if weight], [p.program for p in parts]),
            weighted_sum(self.space.vsa, [1] * len(parts), [part.known for part in parts]),
            distinct_rows(torch.cat([part.results for part in parts]))[0],
            report,
        )
        """The bundle as a behaviour of its own: the same form as each of its parts."""

    @property
    def program(self) -> Shaped[Tensor, "d"]:
        """The weighted sum of the programs."""
        return self.behaviour.program

    def ask(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """See `Policy.ask`."""
        scores = self.behaviour.readout()(conditions)
        # The score of the sum is the weighted sum of the scores that the behaviours give.
        parts = self.behaviour.readout().of(stacked([part.program for part in self.parts]))(conditions)
        weights = torch.tensor(self.weights, dtype=torch.float64, device=scores.device)
        winner = scores.argmax(-1)[:, None, None].expand(-1, len(weights), 1)
        shares = (weights * parts.gather(-1, winner)[..., 0]).masked_fill(weights == 0, -torch.inf)
        return self.behaviour.ask(conditions)._replace(speaker=shares.argmax(-1))


def weighted_sum(vsa: VSA, weights: Sequence[float], vectors: Sequence[Shaped[Tensor, "d"]]) -> Shaped[Tensor, "d"]:
    """`Σ wᵢ vᵢ` of programs as a raw accumulator, exact where all of them, and the weights, are whole.

    Raises `ValueError` if its elements could be larger than 2^53, or if all of them lie below 2^-53.
    """
    rows = stacked(vectors)
    sizes = rows.to(torch.int64 if is_integer(rows) else rows.dtype).abs().amax(-1).tolist()
    largest = sum(abs(weight) * size for weight, size in zip(weights, sizes, strict=True))
    if largest > _LARGEST or 0 < largest < 1 / _LARGEST:
        raise ValueError(
            f"with weights {', '.join(f'{weight:g}' for weight in weights)} the elements of the sum reach {largest:g}; "
            "they are exact, and their squares finite, between 2^-53 and 2^53: give weights nearer to 1"
        )
    if is_integer(rows) and all(isinstance(weight, int) for weight in weights) and largest >= 2**31:
        return (rows.to(torch.float64) * torch.tensor(weights, dtype=torch.float64, device=rows.device)[:, None]).sum(0)
    return vsa.superpose(rows, weights=torch.tensor(weights, device=rows.device))


def stacked(vectors: Sequence[Shaped[Tensor, "d"]]) -> Shaped[Tensor, "b d"]:
    """Programs `[b, d]` in one type: raw and clipped ones (smaller types, bits that count as votes) may be mixed."""
    votes = [signed(vector) for vector in vectors]
    wide = reduce(torch.promote_types, (vote.dtype for vote in votes))
    return torch.stack([vote.to(wide) for vote in votes])


_LARGEST = 2**53
