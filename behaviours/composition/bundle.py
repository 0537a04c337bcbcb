"""Bundling: the weighted sum of the programs is a program."""

from collections.abc import Mapping, Sequence
from functools import reduce

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour, answer
from behaviours.composition.base import Policy
from behaviours.learning.samples import distinct_rows
from behaviours.recall import Recall, scores
from behaviours.report import LearningReport
from torchvsa.exact import norms, signed


class Bundle(Policy):
    """One hypervector for all: `Σ wᵢ pᵢ`, asked like any single program.

    Because recall is linear until the clean-up, this is voting: each result's score is the weighted sum of
    the scores that the behaviours give it. That holds for the raw sum; clipping it would break it. The
    speaker is the behaviour that contributes most to the winning result.

    `weights` default to 1 for every behaviour, in which case integer programs stay integers.
    """

    program: Tensor
    known: Tensor
    results: Tensor

    def __init__(self, bank: BehaviourBank, weights: Mapping[str, float] | None = None) -> None:
        super().__init__(bank, bank.names)
        numbers = self.per_behaviour(weights, [1.0] * len(self.names), "weights")
        whole = bool((numbers == numbers.round()).all())
        self.weights = [int(w) if whole else float(w) for w in numbers.tolist()]
        parts = [bank[name] for name in self.names]
        self.register_buffer("program", self._weighted_sum(self.weights, [b.program for b in parts]))
        self.register_buffer("known", self._weighted_sum([1] * len(parts), [b.known for b in parts]))
        self.register_buffer("results", distinct_rows(torch.cat([b.results for b in parts]))[0])

    def ask(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """See `Policy.ask`."""
        items = self.space.results(self.results)
        lengths = norms(items)
        shares = [
            weight * scores(self.space.vsa, self.bank[name].program, conditions, items, lengths)
            for name, weight in zip(self.names, self.weights, strict=True)
        ]
        recall = answer(self.space, self.program, self.known, self.results, conditions)
        # The sum of the shares rounds differently, which could name another winner where results are tied.
        winner = scores(self.space.vsa, self.program, conditions, items, lengths).argmax(-1)
        speaker = torch.stack([share.gather(-1, winner[:, None])[:, 0] for share in shares]).argmax(0)
        return recall._replace(speaker=speaker)

    def behaviour(self) -> Behaviour:
        """The bundle as a behaviour of its own: the same form as each of its parts."""
        reports = [self.bank[name].report for name in self.names]
        report = LearningReport("bundle", sum(r.samples for r in reports), sum(r.new for r in reports))
        return Behaviour(self.space, self.program, self.known, self.results, report)

    def _weighted_sum(self, weights: Sequence[float], vectors: list[Tensor]) -> Tensor:
        # Raw and clipped programs (smaller types, bits that stand for votes) may stand side by side.
        votes = [signed(vector) for vector in vectors]
        wide = reduce(torch.promote_types, (vote.dtype for vote in votes))
        rows = torch.stack([vote.to(wide) for vote in votes])
        return self.space.vsa.superpose(rows, weights=torch.tensor(weights, device=rows.device))
