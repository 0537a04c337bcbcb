"""Weighted sums of behaviours: their programs and their terms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from behaviours.options import as_float
from behaviours.ordered import distinct_rows
from behaviours.report import LearningReport
from torchvsa import VSA
from torchvsa._numerics import as_bipolar, is_integer

_LARGEST = 2**53
_MIRROR = "mirror of "
"""Begins the fingerprint of a mirror image; the rest is that of the behaviour that was learned."""


@dataclass(frozen=True, eq=False)
class Term:
    """One learned behaviour in a weighted sum, without its program.

    Two terms are equal if their fingerprints are: then programs, known conditions and results are equal.
    """

    name: str
    """The name of the behaviour in its bank; may be empty."""
    weight: float
    """An int if it is whole, else a float."""
    report: LearningReport
    results: Int64[Tensor, "k m"]
    """Its results, as levels of the actuators."""
    fingerprint: str

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not isinstance(self.fingerprint, str) or not self.fingerprint:
            raise ValueError(
                f"the name and the fingerprint of a term are strings; got {self.name!r}, {self.fingerprint!r}"
            )
        object.__setattr__(self, "weight", checked_weight(self.weight))
        if self.weight == 0:
            raise ValueError("the weight of a term cannot be 0")

    @property
    def mirrored(self) -> bool:
        """Whether it is the mirror image of the behaviour that was learned."""
        return self.fingerprint.startswith(_MIRROR)

    def __str__(self) -> str:
        name = ("mirror of " if self.mirrored else "") + (self.name or self.report.rule)
        return name if self.weight == 1 else f"-{name}" if self.weight == -1 else f"{self.weight:g} * {name}"


def checked_weight(value: Any) -> float:
    """`value` as an int if it is whole, else as a float. Raises `ValueError` unless it is a finite number."""
    number = as_float("the weight of a behaviour", value)
    return int(number) if number.is_integer() else number


def merge_terms(terms: Sequence[Term]) -> tuple[Term, ...]:
    """Add the weights of equal terms, and drop terms of weight 0; in order of first appearance."""
    total: dict[str, float] = {}
    first: dict[str, Term] = {}
    for term in terms:
        total[term.fingerprint] = total.get(term.fingerprint, 0) + term.weight
        first.setdefault(term.fingerprint, term)
    return tuple(replace(term, weight=total[key]) for key, term in first.items() if total[key])


def mirrored_term(term: Term, results: Int64[Tensor, "k m"]) -> Term:
    """The mirror image of a term, whose results are `results`. The mirror image of a mirror image is the term."""
    mirrored = term.fingerprint.removeprefix(_MIRROR) if term.mirrored else _MIRROR + term.fingerprint
    return replace(term, results=results, fingerprint=mirrored)


def merged_results(terms: Sequence[Term]) -> Int64[Tensor, "k m"]:
    """The distinct results of all terms."""
    return distinct_rows(torch.cat([term.results for term in terms]))[0]


def merged_report(terms: Sequence[Term]) -> LearningReport:
    """The report of a sum: the counts of all terms added without weights, and the terms as strings."""
    counts = ("samples", "new", "truly_known", "falsely_known", "re_added", "contradicting", "presumed_known")
    total = {name: sum(getattr(term.report, name) for term in terms) for name in counts}
    return LearningReport("sum", **total, terms=tuple(map(str, terms)))


def terms_to_dicts(terms: Sequence[Term], results: Int64[Tensor, "k m"]) -> list[dict[str, Any]]:
    """The terms as plain values, for a file; `terms_from_dicts` is the inverse."""
    rows = [tuple(row) for row in results.tolist()]
    return [
        {
            "name": term.name,
            "weight": term.weight,
            "report": term.report.to_dict(),
            "results": [rows.index(tuple(row)) for row in term.results.tolist()],
            "fingerprint": term.fingerprint,
        }
        for term in terms
    ]


def terms_from_dicts(data: Sequence[Mapping[str, Any]], results: Int64[Tensor, "k m"]) -> tuple[Term, ...]:
    """The inverse of `terms_to_dicts`. Raises `ValueError` unless the terms have exactly these results."""
    terms = []
    for entry in data:
        indices = list(entry["results"])
        if any(isinstance(index, bool) or not isinstance(index, int) or index < 0 for index in indices):
            raise ValueError(f"the results of a term are indices into those of the sum; got {indices!r:.80}")
        report = LearningReport(**entry["report"])
        terms.append(Term(**{**entry, "report": report, "results": results[indices]}))
    if not terms or len(merge_terms(terms)) < len(terms) or not torch.equal(merged_results(terms), results):
        raise ValueError("the terms do not make up the behaviour's results")
    return tuple(terms)


def weighted_sum(vsa: VSA, weights: Sequence[float], vectors: Sequence[Shaped[Tensor, "d"]]) -> Shaped[Tensor, "d"]:
    """The weighted sum `Σ wᵢ vᵢ` as a raw accumulator; exact if all programs and weights are integers.

    Raises `ValueError` if elements of the sum could exceed 2^53, or if all are smaller than 2^-53.
    """
    rows = stack_programs(vectors)
    sizes = rows.to(torch.int64 if is_integer(rows) else rows.dtype).abs().amax(-1).tolist()
    largest = sum(abs(weight) * size for weight, size in zip(weights, sizes, strict=True))
    if largest > _LARGEST or 0 < largest < 1 / _LARGEST:
        raise ValueError(
            f"with weights {', '.join(f'{weight:g}' for weight in weights)} the elements of the sum reach {largest:g}; "
            "only between 2^-53 and 2^53 are they exact and their squares finite: give weights nearer to 1"
        )
    if is_integer(rows) and all(isinstance(weight, int) for weight in weights) and largest >= 2**31:
        return (rows.to(torch.float64) * torch.tensor(weights, dtype=torch.float64, device=rows.device)[:, None]).sum(0)
    return vsa.superpose(rows, weights=torch.tensor(weights, device=rows.device))


def stack_programs(vectors: Sequence[Shaped[Tensor, "d"]]) -> Shaped[Tensor, "b d"]:
    """Stack programs to `[b, d]` in their common type; raw and clipped programs may be mixed, bits become -1 and +1."""
    votes = [as_bipolar(vector) for vector in vectors]
    dtype = reduce(torch.promote_types, (vote.dtype for vote in votes))
    return torch.stack([vote.to(dtype) for vote in votes])
