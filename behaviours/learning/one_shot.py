"""Algorithm 1 of the paper: superpose each pair once."""

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule
from behaviours.learning.samples import Samples
from behaviours.ordered import first_rows, in_order_of_appearance
from behaviours.report import LearningReport
from behaviours.space import Space
from torchvsa.exact import divide, norms, paired_dots


@dataclass(frozen=True)
class OneShot(Rule):
    """Add the pair (condition, result) of every sample whose condition is not known yet.

    `known` decides what *known* means (line 5, isDissimilar): `"equality"` with a stored condition, or the
    paper's `"similarity"` to knownCondHV above a threshold: `sigmas` standard deviations of the similarity
    of unrelated hypervectors, `sigmas / √d`, unless `threshold` gives a cosine. The similarity test takes
    some new conditions for known and, as more are stored, forgets the stored ones.

    `clip_each_step` normalises program and knownCondHV after every addition, as the printed algorithm does
    read literally; only the newest twenty or so pairs of d = 4,000 survive. By default both stay raw sums.

    Source: Neubert et al. 2016, Algorithm 1, with `encode(a_i)` in the clean-up memory for line 10's
    `actuator_i ⊗ encode(a_i)`, which Algorithm 2 could not decode.
    """

    name = "one_shot"

    known: Literal["equality", "similarity"] = "equality"
    sigmas: float = 4.0
    threshold: float | None = None
    clip_each_step: bool = False

    def __post_init__(self) -> None:
        if self.known not in ("equality", "similarity"):
            raise ValueError(f"known is decided by 'equality' or 'similarity'; got {self.known!r}")

    def fit(self, space: Space, demonstrations: Demonstrations) -> Behaviour:
        """See `Rule.fit`: the same bits as the loop over the samples, one by one."""
        samples = Samples.of(space, demonstrations)
        added = _Sums(space, samples, self.clip_each_step)
        if self.known == "equality":
            # Nothing is forgotten: each condition is added where it first appears.
            added.extend(first_rows(samples.condition))
            stored = samples.condition[added.rows]
            accepted = torch.zeros(len(samples.condition), dtype=torch.bool)
            accepted[added.rows] = True
        else:
            threshold = self.sigmas / space.vsa.dim**0.5 if self.threshold is None else self.threshold
            accepted = added.extend_where_dissimilar(threshold)
            stored = samples.condition[added.rows]
        results = samples.results[in_order_of_appearance(samples.result[added.rows])]
        report = _count(self.name, samples, accepted, len(stored))
        return Behaviour(space, added.program, added.known, results, report)


class _Sums:
    """progHV and knownCondHV while pairs are added."""

    def __init__(self, space: Space, samples: Samples, clip: bool) -> None:
        self.vsa, self.samples, self.clip = space.vsa, samples, clip
        self.items = space.results(samples.results)
        self.rows: list[int] = []
        like = samples.conditions
        self.program = torch.zeros(self.vsa.dim, dtype=self.vsa.accumulator, device=like.device)
        self.known = self.program.clone()

    def extend(self, rows: Tensor) -> None:
        """Add the pairs of these samples."""
        if self.clip:
            for row in rows.tolist():
                self.add(row)
            return
        for block in rows.split(256):
            conditions, pairs = self._pairs(block)
            self.program = self.program + self.vsa.superpose(pairs)
            self.known = self.known + self.vsa.superpose(conditions)
        self.rows += rows.tolist()

    def add(self, row: int) -> None:
        """Add the pair of one sample (Algorithm 1, lines 6 and 7)."""
        conditions, pairs = self._pairs(torch.tensor([row]))
        self.program = self._bundle(self.program, pairs)
        self.known = self._bundle(self.known, conditions)
        self.rows.append(row)

    def extend_where_dissimilar(self, threshold: float) -> Tensor:
        """Go through the samples in order and add those that `known` does not resemble; says which."""
        accepted = torch.zeros(len(self.samples.condition), dtype=torch.bool)
        lengths = norms(self.samples.conditions)
        known_length = norms(self.known)
        version = 0
        seen: dict[int, tuple[int, bool]] = {}
        for row, condition in enumerate(self.samples.condition.tolist()):
            # While nothing is added the answer for a condition cannot change.
            asked, is_known = seen.get(condition, (-1, False))
            if asked != version:
                product = paired_dots(self.samples.conditions[condition], self.known)
                # An empty memory resembles nothing, even where the threshold is negative.
                is_known = version > 0 and bool(divide(product, known_length * lengths[condition]) > threshold)
                seen[condition] = version, is_known
            if not is_known:
                self.add(row)
                accepted[row] = True
                known_length = norms(self.known)
                version += 1
        return accepted

    def _pairs(self, rows: Tensor) -> tuple[Tensor, Tensor]:
        conditions = self.samples.conditions[self.samples.condition[rows]]
        return conditions, self.vsa.bind(conditions, self.items[self.samples.result[rows]])

    def _bundle(self, total: Tensor, terms: Tensor) -> Tensor:
        if not self.clip:
            return total + self.vsa.superpose(terms)
        if not self.rows:
            return self.vsa.normalize(self.vsa.superpose(terms))
        return self.vsa.bundle(torch.stack([total.to(terms.dtype), terms[0]]))


def _count(rule: str, samples: Samples, accepted: Tensor, stored: int) -> LearningReport:
    """Tell samples apart by whether their condition had been stored before them, and with which result."""
    count = len(accepted)
    rows = torch.arange(count)
    first_stored = torch.full((len(samples.conditions),), count)
    first_stored = first_stored.scatter_reduce(0, samples.condition[accepted], rows[accepted], "amin")
    first = first_stored[samples.condition]
    before = first < rows
    other = before & (samples.result[first.clamp(max=count - 1)] != samples.result)
    return LearningReport(
        rule,
        samples=count,
        new=int((accepted & ~before).sum()),
        truly_known=int((~accepted & before).sum()),
        falsely_known=int((~accepted & ~before).sum()),
        re_added=stored - int((accepted & ~before).sum()),
        contradicting=int(other.sum()),
    )
