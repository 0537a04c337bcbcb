"""A demonstration as a learning rule sees it: distinct conditions, distinct results, and who met whom."""

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import torch
from jaxtyping import Bool, Int64, Shaped
from torch import Tensor

from behaviours.demonstrations import Demonstrations
from behaviours.learning.conditions import LazyConditions, encode_distinct
from behaviours.ordered import distinct_rows
from behaviours.progress import Progress, no_progress
from behaviours.report import LearningReport
from behaviours.space import Space
from torchvsa import VSA

Contradictions = Literal["first", "majority", "latest"]
"""Which result a condition shown with several of them shall have; the majority is the first among equals."""


def check_contradictions(given: str, *others: str) -> None:
    """Raise `ValueError` unless contradictions are settled by one of `Contradictions`, or of `others`."""
    choices = (*get_args(Contradictions), *others)
    if given not in choices:
        listed = ", ".join(f"{choice!r}" for choice in choices[:-1])
        raise ValueError(f"contradictions are settled by {listed} or {choices[-1]!r}; got {given!r}")


@dataclass(frozen=True)
class Samples:
    """N samples over k distinct conditions and r distinct results, both in order of first appearance."""

    conditions: Shaped[Tensor, "k d"] | LazyConditions
    """The protected conditions; very many of them are encoded when they are asked for."""
    results: Int64[Tensor, "r m"]
    """The results, as levels of the actuators."""
    condition: Int64[Tensor, "N"]
    """Which condition each sample has."""
    result: Int64[Tensor, "N"]
    """Which result each sample has."""

    @classmethod
    def of(cls, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> "Samples":
        """Check, quantise and encode a demonstration; conditions are the same if their hypervectors are.

        `progress` is told the share that is done, if it takes long. Raises if a row has no observed sensor.
        """
        demonstrations.check_names(space.schema)
        cells = space.cells(demonstrations.sensors, demonstrations.episodes)
        blind = (cells < 0).all(-1)
        if blind.any():
            raise ValueError(f"row {int(blind.nonzero()[0])} of the demonstration has no observed sensor")
        levels = space.schema.command_levels(demonstrations.commands).to(cells.device)
        conditions, condition = encode_distinct(space, cells, progress)
        distinct_results, result = distinct_rows(levels)
        return cls(conditions, distinct_results, condition, result)

    def with_known_results(self, results: Int64[Tensor, "p m"]) -> "Samples":
        """The same samples, where `results` were stored before: they come first, and new ones behind them."""
        joined, which = distinct_rows(torch.cat([results, self.results]))
        return replace(self, results=joined, result=which[len(results) :][self.result])

    def targets(self, contradictions: Contradictions) -> Int64[Tensor, "k"]:
        """The result that each condition shall have, where contradictions are settled so."""
        rows = torch.arange(len(self.condition), device=self.condition.device)
        conditions, results = len(self.conditions), len(self.results)
        if contradictions == "majority":
            cells = self.condition * results + self.result
            counts = torch.bincount(cells, minlength=conditions * results).view(conditions, results)
            first = torch.full_like(counts.view(-1), len(rows)).scatter_reduce(0, cells, rows, "amin")
            leaders = counts == counts.amax(-1, keepdim=True)
            return torch.where(leaders, first.view_as(counts), len(rows)).argmin(-1)
        pick = "amin" if contradictions == "first" else "amax"
        chosen = torch.zeros(conditions, dtype=torch.int64, device=rows.device)
        return self.result[chosen.scatter_reduce(0, self.condition, rows, pick, include_self=False)]

    def resolved(self, contradictions: Contradictions) -> "Samples":
        """The same samples, each with the result that its condition shall have."""
        return replace(self, result=self.targets(contradictions)[self.condition])

    def missed(self, answers: Int64[Tensor, "k"]) -> Bool[Tensor, "k"]:
        """Which conditions are answered with a result that is none of their most frequent ones."""
        shape = len(self.conditions), len(self.results)
        counts = torch.bincount(self.condition * shape[1] + self.result, minlength=shape[0] * shape[1]).view(shape)
        return counts.gather(1, answers[:, None])[:, 0] < counts.amax(1)

    def report(self, rule: str, **counts: Any) -> LearningReport:
        """The report of a rule that trains on all conditions, with its further `counts`."""
        samples, distinct = len(self.condition), len(self.conditions)
        return LearningReport(rule, samples=samples, new=distinct, truly_known=samples - distinct, **counts)

    def known(self, vsa: VSA) -> Shaped[Tensor, "d"]:
        """The sum of the distinct conditions, as a raw accumulator."""
        total = torch.zeros(vsa.dim, dtype=vsa.accumulator, device=self.conditions.device)
        for block in self.conditions.split(256):
            total = total + vsa.superpose(block)
        return total
