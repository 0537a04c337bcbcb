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
from torchvsa.exact import norms, signed


class Bundle(Policy):
    """One hypervector for all: `Σ wᵢ pᵢ`, asked like any single program.

    Because recall is linear until the clean-up, this is voting: each result's score is the weighted sum of
    the scores that the behaviours give it. That holds for the raw sum; clipping it would break it. The
    speaker is the behaviour that contributes most to the winning result.

    `weights` default to 1 for every behaviour, in which case integer programs stay integers.
    """

    def __init__(self, bank: BehaviourBank, weights: Mapping[str, float] | None = None) -> None:
        super().__init__(bank, bank.names)
        numbers = self.per_behaviour(weights, [1.0] * len(self.names), "weights")
        whole = bool((numbers == numbers.round()).all())
        self.weights = [int(w) if whole else float(w) for w in numbers.tolist()]
        parts = self.parts
        report = LearningReport("bundle", sum(p.report.samples for p in parts), sum(p.report.new for p in parts))
        self.behaviour = Behaviour(
            self.space,
            self._weighted_sum(self.weights, [part.program for part in parts]),
            self._weighted_sum([1] * len(parts), [part.known for part in parts]),
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
            for part, weight in zip(self.parts, self.weights, strict=True)
        ]
        return self.behaviour.ask(conditions)._replace(speaker=torch.stack(shares).argmax(0))

    def _weighted_sum(self, weights: Sequence[float], vectors: list[Tensor]) -> Tensor:
        # Raw and clipped programs (smaller types, bits that stand for votes) may stand side by side.
        votes = [signed(vector) for vector in vectors]
        wide = reduce(torch.promote_types, (vote.dtype for vote in votes))
        rows = torch.stack([vote.to(wide) for vote in votes])
        return self.space.vsa.superpose(rows, weights=torch.tensor(weights, device=rows.device))
