"""Perceptron learning: correct the program where its recall is wrong."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule, continued
from behaviours.learning.convergence import warn_if_wrong
from behaviours.learning.pairs import BLOCK, Pairs
from behaviours.learning.samples import Contradictions, Samples, check_contradictions
from behaviours.memory import require_levels
from behaviours.options import as_bool, as_float, as_int, set_fields
from behaviours.progress import Progress, no_progress, subrange
from behaviours.space import Space
from torchvsa._numerics import as_bipolar, is_integer


@dataclass(frozen=True)
class ErrorDriven(Rule):
    """A perceptron: add a pair again whenever its result does not lead by a margin.

    A pair is correct if its result scores higher than every other stored result, and higher than 0 (the expected score
    for a condition that was never shown), by at least `margin` times the score that one stored pair gives itself.
    Otherwise the pair is added once more, and the pair of the condition and the rival result is subtracted, if the
    rival scores above 0. The comparison with 0 matters when programs are added: without it, a behaviour with a single
    result would score lower than the others.

    The program stays a raw sum of d numbers, integers for integer codes. With `average` the result is the mean of the
    program over all visits of pairs, a float vector. It depends less on the last corrections; pairs that are correct
    at the end need not be so for the mean.

    Training ends when all pairs are correct, after `epochs`, or early: when the corrections of the last `patience`
    epochs, compared with those of the `patience` epochs before, fall so slowly that about a third of the pairs would
    still be corrected in the last of `epochs`. After an early end the result is the program, among those at the end of
    the last `patience` epochs, that recalls the fewest pairs wrongly; otherwise it is the last program. (With
    `patience` above half of `epochs`, training never ends early.)

    `evidence` makes what was shown often louder: the margin of a pair whose condition was shown n times is
    `margin + evidence · log(1 + n)`. Of behaviours that are learned apart and added, the one that has seen more of a
    condition then decides. A larger `margin` than that of the others gives a behaviour precedence over them. On
    `silent` conditions, every result is kept within half of the score of a stored pair from 0.

    `contradictions` says which result a condition shown with several is trained on: the `"first"` (as in the paper),
    the `"majority"` (ties are broken by first appearance), or the `"latest"`.

    Source: the perceptron (Rosenblatt 1958), in hyperdimensional computing e.g. AdaptHD (Imani et al. 2019);
    its average, Freund and Schapire 1999, "Large margin classification using the perceptron algorithm".
    """

    name = "error_driven"
    supports_partial_fit = True
    supports_silence = True

    margin: float = 0.5
    epochs: int = 200
    contradictions: Contradictions = "majority"
    average: bool = False
    patience: int = 30
    evidence: float = 0.0

    def __post_init__(self) -> None:
        check_contradictions(self.contradictions)
        set_fields(
            self,
            margin=as_float("margin", self.margin, 0),
            evidence=as_float("evidence", self.evidence, 0),
            epochs=as_int("epochs", self.epochs, 1),
            average=as_bool("average", self.average),
            patience=as_int("patience", self.patience, 1),
        )

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        """Learn a behaviour, see `Rule.fit`."""
        samples = Samples.of(space, demonstrations, subrange(progress, 0, _ENCODING_SHARE))
        return self._learn(space, samples, None, progress)

    def fit_beside(
        self, space: Space, demonstrations: Demonstrations, silent: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        """Learn a behaviour that is silent where others have an opinion, see `Rule.fit_beside`."""
        samples = Samples.of(space, demonstrations, subrange(progress, 0, _ENCODING_SHARE), silent)
        return self._learn(space, samples, None, progress)

    def partial_fit(
        self, behaviour: Behaviour, demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        """Correct the program of `behaviour` for further pairs, see `Rule.partial_fit`.

        Earlier pairs are not visited again, and these corrections may make them wrong.
        """
        require_levels("partial_fit", [behaviour])
        samples = Samples.of(behaviour.space, demonstrations, subrange(progress, 0, _ENCODING_SHARE))
        return self._learn(behaviour.space, samples.with_known_results(behaviour.results), behaviour, progress)

    def _learn(self, space: Space, samples: Samples, before: Behaviour | None, progress: Progress) -> Behaviour:
        targets = samples.targets(self.contradictions)
        margins = self.margin + self.evidence * samples.evidence()
        pairs = Pairs(space.vsa, samples, targets, samples.items(space), margins)
        start = torch.zeros(space.vsa.dim, dtype=space.vsa.accumulator, device=targets.device)
        if before is not None:
            start = start + as_bipolar(before.program).detach()
        trained = self._train(pairs, start, subrange(progress, _ENCODING_SHARE, 1))
        progress(1.0)
        report = samples.report(
            self.name,
            contradicting=int((targets[samples.condition] != samples.result).sum()),
            epochs=trained.epochs,
            updates=trained.updates,
            wrong=trained.short,
        )
        ended_early = trained.epochs < self.epochs
        below = f" and {trained.short - trained.wrong} more below the margin" if trained.short > trained.wrong else ""
        warn_if_wrong(
            type(self).__name__,
            trained.wrong,
            len(targets),
            contradicting=report.contradicting,
            samples=report.samples,
            after=f"{below} after {trained.epochs} epochs",
            remedy="more dimensions (dim)" if ended_early else "more dimensions (dim) or epochs",
        )
        return continued(
            before, Behaviour(space, trained.program, samples.condition_sum(space.vsa), samples.results, report)
        )

    def _train(self, pairs: Pairs, program: Shaped[Tensor, "d"], progress: Progress) -> "_Trained":
        """Train sequentially: pairs are visited in order, each with all earlier corrections applied.

        With corrections c_i made after v_i of V visits, the mean program over all visits is
        start + Σ c_i (V - v_i) / V, which is the last program less `Σ v_i c_i / V`; `weighted` is that sum.
        """
        weighted = torch.zeros_like(program, dtype=_widest(program))
        corrections: list[int] = []
        ends: deque[Tensor] = deque(maxlen=self.patience)
        visits = reported = 0
        stalled = False
        exact = pairs.vsa.integer and is_integer(program)
        readout = pairs.readout.of(program)
        while len(corrections) < self.epochs:
            corrected = start = 0
            size = BLOCK
            while start < len(pairs):
                # Pairs before the first incorrect one do not change the program, so a block of them is scored at
                # once. After a correction the next block starts behind the corrected pair.
                short, add, subtract = pairs.judge(readout, start, size)
                if visits + start - reported >= _PAIRS_PER_REPORT:
                    reported = visits + start
                    progress(reported / (self.epochs * len(pairs)))
                if not short.any():
                    start += len(short)
                    size = min(2 * size, BLOCK)
                    continue
                offset = int(short.to(torch.int8).argmax())
                change = pairs.change(start + offset, int(add[offset]), int(subtract[offset]))
                program = program + change
                readout = pairs.readout.of(program)
                if self.average:
                    weighted = weighted + (visits + start + offset) * change.to(weighted.dtype)
                corrected += 1
                start += offset + 1
                if exact:
                    # Small blocks where corrections are dense, so that few scores are discarded. The last bits of
                    # float scores may depend on the size of the block, so that it stays the same for floats.
                    size = min(2 * offset + 1, BLOCK)
            visits += len(pairs)
            corrections.append(corrected)
            ends.append(program)
            stalled = _stalled(corrections, len(pairs), self.patience, self.epochs)
            if corrected == 0 or stalled:
                break
            progress(visits / (self.epochs * len(pairs)))
        epochs, updates = len(corrections), sum(corrections)
        if self.average:
            mean = (program.to(weighted.dtype) * visits - weighted) / torch.tensor(visits, dtype=torch.float64)
            ends = deque([mean.to(torch.float32 if pairs.vsa.integer else pairs.vsa.dtype)])
        elif corrections[-1] == 0:
            return _Trained(program, epochs, updates, 0, 0)
        elif not stalled:
            ends = deque([program])
        # Each correction changes the scores of all pairs, so that they are all scored again.
        outcomes = [pairs.outcome(end) for end in ends]
        best = min(range(len(ends)), key=outcomes.__getitem__)
        return _Trained(ends[best], epochs, updates, *outcomes[best])


class _Trained(NamedTuple):
    """The result of training."""

    program: Shaped[Tensor, "d"]
    epochs: int
    updates: int
    wrong: int
    """Pairs recalled wrongly."""
    short: int
    """Pairs recalled wrongly or below the margin."""


def _stalled(corrections: Sequence[int], pairs: int, patience: int, epochs: int) -> bool:
    """Whether, at the present rate, about a third of the pairs would still be corrected in the last of `epochs`.

    The rate is the difference between the mean corrections of the last `patience` epochs and of as many before.
    Corrections fall ever more slowly, so that the linear extrapolation is optimistic. The root of the number of pairs
    allows for chance. These numbers were chosen on random pairs near capacity (d from 64 to 1,000, integer codes of
    four kinds, margins 0, 0.5 and 2). With other seeds, none of 761 runs that converge within 200 epochs was ended,
    and 157 of 286 that do not converge were.
    """
    if not 2 * patience <= len(corrections) < epochs:
        return False
    current, before = (
        sum(part) / patience for part in (corrections[-patience:], corrections[-2 * patience : -patience])
    )
    fall = max(before - current, 0) / patience
    return current - fall * (epochs - len(corrections)) > 0.3 * pairs + pairs**0.5


_PAIRS_PER_REPORT = 512
"""Pairs visited between two calls of `progress` within an epoch."""

_ENCODING_SHARE = 0.1
"""The completed share of the work after encoding, for `progress`."""


def _widest(x: Tensor) -> torch.dtype:
    """The widest type of the same kind, for sums over all visits."""
    if is_integer(x):
        return torch.int64
    return torch.complex128 if x.is_complex() else torch.float64
