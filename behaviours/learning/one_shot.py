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
from behaviours.memory import require_levels
from behaviours.options import as_bool, as_float, set_fields
from behaviours.ordered import first_rows, in_order_of_appearance
from behaviours.progress import Progress, no_progress, subrange
from behaviours.report import LearningReport
from behaviours.space import Space


@dataclass(frozen=True)
class OneShot(Rule):
    """Add the pair (condition, result) of each sample whose condition is new.

    `novelty` says when a condition is new (line 5, isDissimilar): `"exact"`, if it differs from every stored condition,
    or `"similarity"`, as in the paper, if its cosine with knownCondHV is at most a threshold. The threshold is `sigmas`
    standard deviations of the similarity of unrelated hypervectors, `sigmas / √d`, unless `threshold` gives a cosine.
    The similarity test skips some new conditions and, as more are stored, stores known ones again.

    `clip_each_step` normalises program and knownCondHV after every addition, as the printed algorithm read literally
    does; with d = 4,000 only the latest twenty or so pairs survive. By default both stay raw sums.

    `contradictions` says which result of a condition shown with several is stored: the `"first"` (as in the paper), the
    `"majority"` (ties are broken by first appearance), or the `"latest"`.

    Source: Neubert et al. 2016, Algorithm 1. The clean-up memory holds `encode(a_i)` instead of line 10's
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
        set_fields(
            self, sigmas=as_float("sigmas", self.sigmas), clip_each_step=as_bool("clip_each_step", self.clip_each_step)
        )
        if self.threshold is not None:
            set_fields(self, threshold=as_float("threshold", self.threshold))

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        """Learn a behaviour, see `Rule.fit`: the same bits as the printed loop over the samples."""
        samples = Samples.of(space, demonstrations, subrange(progress, 0, 0.5))
        return self._learn(space, samples, progress=subrange(progress, 0.5, 1))

    def partial_fit(
        self, behaviour: Behaviour, demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        """Add further pairs, see `Rule.partial_fit`.

        With `contradictions="first"` the bits are those of `fit` on all demonstrations at once. Raises `ValueError` for
        `novelty="exact"`, and for `clip_each_step` with a behaviour that is not clipped.
        """
        require_levels("partial_fit", [behaviour])
        if self.novelty == "exact":
            raise ValueError(
                "novelty='exact' needs all earlier conditions, which a behaviour does not keep; continue with "
                "novelty='similarity'"
            )
        vsa = behaviour.space.vsa
        clipped = vsa.normalize(torch.zeros(vsa.dim, dtype=vsa.accumulator)).dtype
        if self.clip_each_step and behaviour.program.dtype != clipped:
            raise ValueError(
                f"clip_each_step continues from programs of {clipped}; this one is a sum in "
                f"{behaviour.program.dtype}, so continue from behaviour.clipped()"
            )
        samples = Samples.of(behaviour.space, demonstrations, subrange(progress, 0, 0.5))
        return self._learn(
            behaviour.space, samples.with_known_results(behaviour.results), behaviour, subrange(progress, 0.5, 1)
        )

    def _learn(
        self, space: Space, shown: Samples, before: Behaviour | None = None, progress: Progress = no_progress
    ) -> Behaviour:
        samples = shown if self.contradictions == "first" else shown.resolved(self.contradictions)
        accumulator = PairAccumulator(space, samples, self.clip_each_step, progress)
        if before is not None:
            accumulator.resume(before.program, before.known)
        if self.novelty == "exact":
            # Each condition is added at its first appearance.
            accumulator.add(first_rows(samples.condition))
        else:
            threshold = self.sigmas / space.vsa.dim**0.5 if self.threshold is None else self.threshold
            accumulator.add_where_dissimilar(threshold)
        earlier = torch.arange(0 if before is None else len(before.results), device=samples.result.device)
        results = samples.results[in_order_of_appearance(torch.cat([earlier, samples.result[accumulator.rows]]))]
        report = _count(self.name, samples, accumulator.accepted, len(accumulator.rows))
        if self.contradictions != "first":
            report = replace(report, contradicting=int((samples.result != shown.result).sum()))
        if before is not None:
            # Skipped conditions that were not stored here resemble earlier ones, rightly or by chance.
            report = before.report.merged(replace(report, presumed_known=report.falsely_known, falsely_known=0))
        return Behaviour(space, accumulator.program, accumulator.known, results, report)


def _count(rule: str, samples: Samples, accepted: Tensor, stored: int) -> LearningReport:
    """Count the samples by whether their condition was stored before them, and with which result."""
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
