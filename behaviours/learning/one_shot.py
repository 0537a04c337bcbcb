"""Algorithm 1 of the paper: superpose each pair once."""

from dataclasses import dataclass, replace
from typing import Literal

import torch
from torch import Tensor

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule
from behaviours.learning.pair_accumulator import PairAccumulator
from behaviours.learning.samples import Contradictions, Samples, check_contradictions
from behaviours.options import flag, number, store
from behaviours.ordered import first_rows, in_order_of_appearance
from behaviours.progress import Progress, no_progress, subrange
from behaviours.report import LearningReport
from behaviours.space import Space


@dataclass(frozen=True)
class OneShot(Rule):
    """Add the pair (condition, result) of every sample whose condition is not known yet.

    `known` decides what *known* means (line 5, isDissimilar): `"exact"` with a stored condition, or the
    paper's `"similarity"` to knownCondHV above a threshold: `sigmas` standard deviations of the similarity
    of unrelated hypervectors, `sigmas / √d`, unless `threshold` gives a cosine. The similarity test takes
    some new conditions for known and, as more are stored, forgets the stored ones.

    `clip_each_step` normalises program and knownCondHV after every addition, as the printed algorithm does
    read literally; only the newest twenty or so pairs of d = 4,000 survive. By default both stay raw sums.

    `contradictions`: as printed, a condition shown with several results keeps the one with which it was stored
    (`"first"`); else each of its samples shows the `"majority"` of them (the first among equals), or the `"latest"`.

    Source: Neubert et al. 2016, Algorithm 1, with `encode(a_i)` in the clean-up memory for line 10's
    `actuator_i ⊗ encode(a_i)`, which Algorithm 2 could not decode.
    """

    name = "one_shot"
    supports_partial_fit = True

    novelty: Literal["exact", "similarity"] = "exact"
    sigmas: float = 4.0
    threshold: float | None = None
    clip_each_step: bool = False
    contradictions: Contradictions = "first"

    def __post_init__(self) -> None:
        check_contradictions(self.contradictions)
        if self.novelty not in ("exact", "similarity"):
            raise ValueError(f"novelty is 'exact' or 'similarity'; got {self.novelty!r}")
        store(self, sigmas=number("sigmas", self.sigmas), clip_each_step=flag("clip_each_step", self.clip_each_step))
        if self.threshold is not None:
            store(self, threshold=number("threshold", self.threshold))

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        """See `Rule.fit`: the same bits as the loop over the samples, one by one."""
        samples = Samples.of(space, demonstrations, subrange(progress, 0, 0.5))
        return self._learn(space, samples, progress=subrange(progress, 0.5, 1))

    def partial_fit(
        self, behaviour: Behaviour, demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        """See `Rule.partial_fit`: with contradictions settled by the first, the same bits as `fit` on all at once.

        Raises `ValueError` for `known="exact"`, and if a program that was never clipped shall be clipped now.
        """
        if self.novelty == "exact":
            raise ValueError(
                "a single hypervector does not remember which conditions it holds, so that no later piece can be "
                "compared with them exactly; learn in pieces with novelty='similarity'"
            )
        vsa = behaviour.space.vsa
        clipped = vsa.normalize(torch.zeros(vsa.dim, dtype=vsa.accumulator)).dtype
        if self.clip_each_step and behaviour.program.dtype != clipped:
            raise ValueError(
                f"clip_each_step goes on from programs of {clipped}; this one is a sum in "
                f"{behaviour.program.dtype}, so go on from behaviour.clipped()"
            )
        samples = Samples.of(behaviour.space, demonstrations, subrange(progress, 0, 0.5)).with_known_results(
            behaviour.results
        )
        return self._learn(behaviour.space, samples, behaviour, subrange(progress, 0.5, 1))

    def _learn(
        self, space: Space, shown: Samples, before: Behaviour | None = None, progress: Progress = no_progress
    ) -> Behaviour:
        samples = shown if self.contradictions == "first" else shown.resolved(self.contradictions)
        added = PairAccumulator(space, samples, self.clip_each_step, progress)
        if before is not None:
            added.resume(before.program, before.known)
        if self.novelty == "exact":
            # Nothing is forgotten: each condition is added where it first appears.
            added.add(first_rows(samples.condition))
        else:
            threshold = self.sigmas / space.vsa.dim**0.5 if self.threshold is None else self.threshold
            added.add_where_dissimilar(threshold)
        held = torch.arange(0 if before is None else len(before.results), device=samples.result.device)
        results = samples.results[in_order_of_appearance(torch.cat([held, samples.result[added.rows]]))]
        report = _count(self.name, samples, added.accepted, len(added.rows))
        if self.contradictions != "first":
            report = replace(report, contradicting=int((samples.result != shown.result).sum()))
        if before is not None:
            # What this piece never stored was known from before, or seemed to be.
            piece = replace(report, presumed_known=report.falsely_known, falsely_known=0)
            report = before.report.merged(piece)
        return Behaviour(space, added.program, added.known, results, report)


def _count(rule: str, samples: Samples, accepted: Tensor, stored: int) -> LearningReport:
    """Tell samples apart by whether their condition had been stored before them, and with which result."""
    count = len(accepted)
    rows = torch.arange(count, device=accepted.device)
    first_stored = torch.full((len(samples.conditions),), count, device=accepted.device)
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
