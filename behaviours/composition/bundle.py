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
from behaviours.recall import Recall, scores
from behaviours.report import LearningReport
from torchvsa import VSA
from torchvsa.exact import is_integer, norms, signed


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
        vsa, items = self.space.vsa, self.behaviour.memory.items
        lengths = norms(items)
        winner = scores(vsa, self.behaviour.program, conditions, items, lengths).argmax(-1)
        shares = [
            weight * scores(vsa, part.program, conditions, items, lengths).gather(-1, winner[:, None])[:, 0]
            if weight
            else torch.full_like(winner, -torch.inf, dtype=torch.float64)
            for part, weight in zip(self.parts, self.weights, strict=True)
        ]
        return self.behaviour.ask(conditions)._replace(speaker=torch.stack(shares).argmax(0))


def weighted_sum(vsa: VSA, weights: Sequence[float], vectors: Sequence[Shaped[Tensor, "d"]]) -> Shaped[Tensor, "d"]:
    """`Σ wᵢ vᵢ` of programs as a raw accumulator, exact where all of them, and the weights, are whole.

    Raises `ValueError` if its elements could be larger than 2^53, or if all of them lie below 2^-53.
    """
    # Raw and clipped programs (smaller types, bits that stand for votes) may stand side by side.
    votes = [signed(vector) for vector in vectors]
    wide = reduce(torch.promote_types, (vote.dtype for vote in votes))
    rows = torch.stack([vote.to(wide) for vote in votes])
    sizes = [vote.to(torch.int64 if is_integer(vote) else vote.dtype).abs().max().item() for vote in votes]
    largest = sum(abs(weight) * size for weight, size in zip(weights, sizes, strict=True))
    if largest > _LARGEST or 0 < largest < 1 / _LARGEST:
        raise ValueError(
            f"with weights {', '.join(f'{weight:g}' for weight in weights)} the elements of the sum reach {largest:g}; "
            "they are exact, and their squares finite, between 2^-53 and 2^53: give weights nearer to 1"
        )
    if is_integer(rows) and all(isinstance(weight, int) for weight in weights) and largest >= 2**31:
        return (rows.to(torch.float64) * torch.tensor(weights, dtype=torch.float64, device=rows.device)[:, None]).sum(0)
    return vsa.superpose(rows, weights=torch.tensor(weights, device=rows.device))


_LARGEST = 2**53
