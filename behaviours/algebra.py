"""Sums of behaviours: their programs, and what they are made of."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import reduce
from numbers import Real
from typing import Any

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from behaviours.ordered import distinct_rows
from behaviours.report import LearningReport
from torchvsa import VSA
from torchvsa._numerics import as_bipolar, is_integer

_LARGEST = 2**53


@dataclass(frozen=True, eq=False)
class Term:
    """A learned behaviour within a sum, without its program.

    Terms are the same where their fingerprints are: then programs, known conditions and results are equal.
    """

    name: str
    """The name under which a bank kept it; may be empty."""
    weight: float
    """A plain int where it is whole."""
    report: LearningReport
    results: Int64[Tensor, "k m"]
    """Its results, as levels of the actuators."""
    fingerprint: str

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not isinstance(self.fingerprint, str) or not self.fingerprint:
            raise ValueError(f"a term has a name and a fingerprint, texts; got {self.name!r}, {self.fingerprint!r}")
        object.__setattr__(self, "weight", checked_weight(self.weight))
        if self.weight == 0:
            raise ValueError("the weight of a term is not 0")

    def __str__(self) -> str:
        name = self.name or self.report.rule
        return name if self.weight == 1 else f"-{name}" if self.weight == -1 else f"{self.weight:g} * {name}"


def checked_weight(value: Any) -> float:
    """A weight as a plain number, an int where it is whole. Raises `ValueError` for what is no finite number."""
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise ValueError(f"the weight of a behaviour is a finite number; got {value!r}")
    number = float(value)
    return int(number) if number.is_integer() else number


def added(terms: Sequence[Term]) -> tuple[Term, ...]:
    """The terms, in order of first appearance: weights of the same add up, and those that cancel are left out."""
    total: dict[str, float] = {}
    first: dict[str, Term] = {}
    for term in terms:
        total[term.fingerprint] = total.get(term.fingerprint, 0) + term.weight
        first.setdefault(term.fingerprint, term)
    return tuple(replace(term, weight=total[key]) for key, term in first.items() if total[key])


def results_of(terms: Sequence[Term]) -> Int64[Tensor, "k m"]:
    """The results of all terms, each once."""
    return distinct_rows(torch.cat([term.results for term in terms]))[0]


def report_of(terms: Sequence[Term]) -> LearningReport:
    """The counts of all terms, whatever their weights, and what the terms are."""
    counts = ("samples", "new", "truly_known", "falsely_known", "re_added", "contradicting", "presumed_known")
    total = {name: sum(getattr(term.report, name) for term in terms) for name in counts}
    return LearningReport("sum", **total, terms=tuple(map(str, terms)))


def described(terms: Sequence[Term], results: Int64[Tensor, "k m"]) -> list[dict[str, Any]]:
    """Plain values, for a file; `terms_from` is the inverse."""
    rows = [tuple(row) for row in results.tolist()]
    return [
        {
            **asdict(replace(term, results=None)),  # type: ignore[arg-type] (a tensor is no plain value)
            "report": term.report.to_dict(),
            "results": [rows.index(tuple(row)) for row in term.results.tolist()],
        }
        for term in terms
    ]


def terms_from(data: Sequence[Mapping[str, Any]], results: Int64[Tensor, "k m"]) -> tuple[Term, ...]:
    """The terms that `described` describes. Raises `ValueError` unless they have these results, all of them."""
    terms = []
    for entry in data:
        places = list(entry["results"])
        if any(isinstance(place, bool) or not isinstance(place, int) or place < 0 for place in places):
            raise ValueError(f"the results of a term are places in those of the sum; got {places!r:.80}")
        report = LearningReport(**entry["report"])
        terms.append(Term(**{**entry, "report": report, "results": results[places]}))
    if not terms or len(added(terms)) < len(terms) or not torch.equal(results_of(terms), results):
        raise ValueError("the terms do not make up the behaviour's results")
    return tuple(terms)


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
    votes = [as_bipolar(vector) for vector in vectors]
    wide = reduce(torch.promote_types, (vote.dtype for vote in votes))
    return torch.stack([vote.to(wide) for vote in votes])
