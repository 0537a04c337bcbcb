"""Demonstrations as index arrays into their distinct conditions and results."""

from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, get_args

import torch
from jaxtyping import Bool, Float64, Int64, Shaped
from torch import Tensor

from behaviours.demonstrations import Demonstrations
from behaviours.learning.conditions import LazyConditions, encode_distinct
from behaviours.ordered import distinct_rows, first_rows
from behaviours.progress import Progress, no_progress
from behaviours.report import LearningReport
from behaviours.space import Space
from behaviours.tables import to_float64
from torchvsa import VSA

Contradictions = Literal["first", "majority", "latest"]
"""How to resolve a condition shown with several results; `"majority"` breaks ties by first appearance."""


def check_contradictions(given: str, *others: str) -> None:
    """Raise `ValueError` unless `given` is one of `Contradictions` or of `others`."""
    choices = (*get_args(Contradictions), *others)
    if given not in choices:
        listed = ", ".join(f"{choice!r}" for choice in choices[:-1])
        raise ValueError(f"contradictions is {listed} or {choices[-1]!r}; got {given!r}")


@dataclass(frozen=True)
class Samples:
    """N samples over k distinct conditions and r distinct results, both in order of first appearance."""

    conditions: Shaped[Tensor, "k d"] | LazyConditions
    """The protected conditions; if there are very many, they are encoded on access."""
    results: Int64[Tensor, "r m"]
    """The results, as levels of the actuators."""
    condition: Int64[Tensor, "N"]
    """The index of each sample's condition."""
    result: Int64[Tensor, "N"]
    """The index of each sample's result."""
    silent: Shaped[Tensor, "q d"] | LazyConditions | None = None
    """Further conditions, on which a behaviour is to be silent."""
    rivals: Int64[Tensor, "s m"] | None = None
    """Further results, which others may have: they are not to win, but are not stored."""
    weights: Float64[Tensor, "N"] | None = None
    """How much each sample counts in the loss of `Gradient`; their mean is 1."""

    @classmethod
    def of(
        cls,
        space: Space,
        demonstrations: Demonstrations,
        progress: Progress = no_progress,
        silent: Demonstrations | None = None,
    ) -> "Samples":
        """Check, quantise and encode demonstrations. Conditions are equal if their hypervectors are.

        Of `silent` only the readings are used, in conditions that the demonstrations do not show. Raises `ValueError`
        for invalid readings or commands, and for a row in which no sensor was observed.
        """
        demonstrations.check_names(space.schema)
        cells = space.cells(demonstrations.sensors, demonstrations.episodes)
        blind = (cells < 0).all(-1)
        if blind.any():
            raise ValueError(f"row {int(blind.nonzero()[0])} of the demonstrations has no observed sensor")
        levels = space.schema.command_levels(demonstrations.commands).to(cells.device)
        conditions, condition = encode_distinct(space, cells, progress)
        distinct_results, result = distinct_rows(levels)
        if silent is None:
            return cls(conditions, distinct_results, condition, result)
        others = _others(space, cells, silent)
        return cls(conditions, distinct_results, condition, result, others, _rivals(space, distinct_results, silent))

    def with_known_results(self, results: Int64[Tensor, "p m"]) -> "Samples":
        """The same samples, with indices into `results` (stored before) followed by the new results."""
        joined, index = distinct_rows(torch.cat([results, self.results]))
        return replace(self, results=joined, result=index[len(results) :][self.result])

    def weighted(self, weights: Any) -> "Samples":
        """The same samples with these weights, scaled to a mean of 1. Raises `ValueError` unless all are positive."""
        if weights is None:
            return self
        given = to_float64(weights, "weights").to(self.condition.device)
        if given.shape != self.condition.shape or not (given.isfinite() & (given > 0)).all():
            raise ValueError(
                f"weights are one positive, finite number per row, [{len(self.condition)}]; got shape "
                f"{tuple(given.shape)}, from {given.min().item():g} to {given.max().item():g}"
            )
        # Divided by the largest first, so that the sum is finite.
        given = given / given.max()
        return self if (given == 1).all() else replace(self, weights=given / given.mean())

    def targets(self, contradictions: Contradictions) -> Int64[Tensor, "k"]:
        """The index of the result to learn for each condition, with contradictions resolved."""
        rows = torch.arange(len(self.condition), device=self.condition.device)
        if contradictions == "majority":
            pairs = self._pairs()
            often = pairs.shown == self._most(pairs)[pairs.condition]
            first = first_rows(pairs.of_sample)[often]
            chosen = torch.full((len(self.conditions),), len(rows), device=rows.device)
            return self.result[chosen.scatter_reduce(0, pairs.condition[often], first, "amin")]
        pick = "amin" if contradictions == "first" else "amax"
        chosen = torch.zeros(len(self.conditions), dtype=torch.int64, device=rows.device)
        return self.result[chosen.scatter_reduce(0, self.condition, rows, pick, include_self=False)]

    def items(self, space: Space) -> Shaped[Tensor, "r+s d"]:
        """The hypervectors of all results, those of rivals last."""
        return space.items(self.results if self.rivals is None else torch.cat([self.results, self.rivals]))

    def evidence(self) -> Float64[Tensor, "k"]:
        """log(1 + n) for each condition, which was shown n times."""
        return torch.bincount(self.condition).to(torch.float64).log1p()

    def resolved(self, contradictions: Contradictions) -> "Samples":
        """The same samples, each with the result to learn for its condition, see `targets`."""
        return replace(self, result=self.targets(contradictions)[self.condition])

    def missed(self, predicted: Int64[Tensor, "k"]) -> Bool[Tensor, "k"]:
        """Whether the predicted result of each condition is none of its most frequent results."""
        pairs = self._pairs()
        asked = torch.arange(len(predicted), device=predicted.device) * len(self.results) + predicted
        place = torch.searchsorted(pairs.cell, asked).clamp(max=len(pairs.cell) - 1)
        return torch.where(pairs.cell[place] == asked, pairs.shown[place], 0) < self._most(pairs)

    def _pairs(self) -> "_Pairs":
        # A table of all conditions and results would take 8 · k · r bytes, gigabytes for a million conditions.
        results = len(self.results)
        cells = self.condition * results + self.result
        cell, of_sample, shown = cells.unique(return_inverse=True, return_counts=True)
        return _Pairs(cell, cell // results, of_sample, shown)

    def _most(self, pairs: "_Pairs") -> Int64[Tensor, "k"]:
        """How often the most frequent result of each condition was shown."""
        most = torch.zeros(len(self.conditions), dtype=torch.int64, device=pairs.shown.device)
        return most.scatter_reduce(0, pairs.condition, pairs.shown, "amax")

    def report(self, rule: str, **counts: Any) -> LearningReport:
        """The report of a rule that learns every condition; `counts` are further fields of it."""
        samples, distinct = len(self.condition), len(self.conditions)
        return LearningReport(rule, samples=samples, new=distinct, truly_known=samples - distinct, **counts)

    def condition_sum(self, vsa: VSA) -> Shaped[Tensor, "d"]:
        """The sum of the distinct conditions, as a raw accumulator."""
        total = torch.zeros(vsa.dim, dtype=vsa.accumulator, device=self.conditions.device)
        for block in self.conditions.split(_ROWS):
            total = total + vsa.superpose(block)
        return total


class _Pairs(NamedTuple):
    """The p distinct pairs of a condition and a result that were shown."""

    cell: Int64[Tensor, "p"]
    """condition · r + result, ascending."""
    condition: Int64[Tensor, "p"]
    of_sample: Int64[Tensor, "N"]
    """The pair of each sample."""
    shown: Int64[Tensor, "p"]
    """How often each was shown."""


def _others(
    space: Space, cells: Shaped[Tensor, "N w"], silent: Demonstrations
) -> Shaped[Tensor, "q d"] | LazyConditions | None:
    """The distinct conditions of `silent` that are not among those of `cells`; None for no such condition."""
    silent.check_names(space.schema)
    more = space.cells(silent.sensors, silent.episodes)
    distinct, index = distinct_rows(torch.cat([cells, more[(more >= 0).any(-1)]]))
    new = torch.ones(len(distinct), dtype=torch.bool, device=cells.device)
    new[index[: len(cells)]] = False
    return encode_distinct(space, distinct[new])[0] if new.any() else None


def _rivals(space: Space, results: Int64[Tensor, "r m"], silent: Demonstrations) -> Int64[Tensor, "s m"]:
    """The results that only others have; which condition has which is not used."""
    theirs = space.schema.command_levels(silent.commands).to(results.device)
    return distinct_rows(torch.cat([results, theirs]))[0][len(results) :]


_ROWS = 256
"""Conditions superposed in one call; bounds the memory."""
