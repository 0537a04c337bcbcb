"""Correct the program where its recall is wrong."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float64, Int64, Shaped
from torch import Tensor

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule, continued
from behaviours.learning.conditions import LazyConditions
from behaviours.learning.convergence import warn_if_wrong
from behaviours.learning.samples import Contradictions, Samples, check_contradictions
from behaviours.options import flag, number, store, whole
from behaviours.progress import Progress, no_progress, subrange
from behaviours.space import Space
from torchvsa import VSA
from torchvsa._numerics import as_bipolar, is_integer, norms


@dataclass(frozen=True)
class ErrorDriven(Rule):
    """Go through the pairs until each is recalled with a margin, adding a pair where it is not.

    A pair is in order if its result scores higher than every other stored result, and than silence (score 0,
    the answer to a condition that was never met), by `margin` times the score that one stored pair gives
    itself. Otherwise the pair is added once more, and the rival result, if there is one, is taken away from
    that condition. The reference to silence matters when programs are added: it makes a behaviour that knows
    one result only speak up as clearly as the others.

    The program stays one raw sum of d numbers; integers for integer codes. `average` answers with the mean of the
    program over all visits of pairs instead, which does not hang on the last corrections: a float vector, and pairs
    that are in order at the end need not be so in the mean.

    Training ends when all pairs are in order, after `epochs`, or early where it would not get there: once the
    corrections of the last `patience` epochs, compared with those of the `patience` epochs before, fall so slowly that
    in the last of `epochs` about a third of the pairs would still be corrected. It then returns, of the programs
    at the end of the last `patience` epochs, the one that recalls the fewest pairs wrongly. (A run that ends at
    `epochs` returns its last program; `patience` of more than half of `epochs` never ends a run early.)

    `contradictions` decides for a condition shown with several results: the `"first"` (as the paper does),
    the `"majority"` (the first among equals), or the `"latest"`.

    Source: the perceptron (Rosenblatt 1958), in hyperdimensional computing e.g. AdaptHD (Imani et al. 2019);
    its average, Freund and Schapire 1999, "Large margin classification using the perceptron algorithm".
    """

    name = "error_driven"
    supports_partial_fit = True

    margin: float = 0.5
    epochs: int = 200
    contradictions: Contradictions = "majority"
    average: bool = False
    patience: int = 30

    def __post_init__(self) -> None:
        check_contradictions(self.contradictions)
        store(
            self,
            margin=number("margin", self.margin, 0),
            epochs=whole("epochs", self.epochs, 1),
            average=flag("average", self.average),
            patience=whole("patience", self.patience, 1),
        )

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        """See `Rule.fit`."""
        samples = Samples.of(space, demonstrations, subrange(progress, 0, _ENCODED))
        return self._learn(space, samples, None, progress)

    def partial_fit(
        self, behaviour: Behaviour, demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        """See `Rule.partial_fit`: the pairs of this piece are set right, from the program at hand on.

        Earlier pairs are not visited again, and later corrections may disturb them.
        """
        samples = Samples.of(behaviour.space, demonstrations, subrange(progress, 0, _ENCODED))
        return self._learn(behaviour.space, samples.with_known_results(behaviour.results), behaviour, progress)

    def _learn(self, space: Space, samples: Samples, before: Behaviour | None, progress: Progress) -> Behaviour:
        targets = samples.targets(self.contradictions)
        pairs = _Pairs(space.vsa, samples.conditions, targets, space.items(samples.results), self.margin)
        start = torch.zeros(space.vsa.dim, dtype=space.vsa.accumulator, device=targets.device)
        if before is not None:
            start = start + as_bipolar(before.program).detach()
        trained = self._train(pairs, start, subrange(progress, _ENCODED, 1))
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
        return continued(before, Behaviour(space, trained.program, samples.known(space.vsa), samples.results, report))

    def _train(self, pairs: "_Pairs", program: Shaped[Tensor, "d"], progress: Progress) -> "_Trained":
        """The sequential perceptron: the pairs are visited in order, and each sees all corrections before it."""
        # Each correction times the visits before it: what the mean over all visits lacks of it.
        late = torch.zeros_like(program, dtype=_widest(program))
        corrections: list[int] = []
        ends: deque[Tensor] = deque(maxlen=self.patience)
        visits = told = 0
        hopeless = False
        exact = pairs.vsa.integer and is_integer(program)
        while len(corrections) < self.epochs:
            corrected = start = 0
            size = _BLOCK
            while start < len(pairs):
                # Pairs up to the first one out of order leave the program as it is, so a block of them is
                # asked at once; the block after a correction starts behind it.
                short, rivals, rival_scores = pairs.judge(program, start, size)
                if visits + start - told >= _TOLD:
                    told = visits + start
                    progress(told / (self.epochs * len(pairs)))
                if not short.any():
                    start += size
                    size = min(2 * size, _BLOCK)
                    continue
                at = int(short.to(torch.int8).argmax())
                rival = int(rivals[at]) if rival_scores[at] > 0 else None
                change = pairs.change(start + at, rival)
                program = program + change
                if self.average:
                    late = late + (visits + start + at) * change.to(late.dtype)
                corrected += 1
                start += at + 1
                if exact:
                    # The denser the corrections, the fewer pairs are asked in vain. (Scores of floats may depend on
                    # the size of the block in their last bits, so that theirs stays the same.)
                    size = min(2 * at + 1, _BLOCK)
            visits += len(pairs)
            corrections.append(corrected)
            ends.append(program)
            hopeless = _hopeless(corrections, len(pairs), self.patience, self.epochs)
            if corrected == 0 or hopeless:
                break
            progress(visits / (self.epochs * len(pairs)))
        epochs, updates = len(corrections), sum(corrections)
        if self.average:
            mean = (program.to(late.dtype) * visits - late) / torch.tensor(visits, dtype=torch.float64)
            ends = deque([mean.to(torch.float32 if pairs.vsa.integer else pairs.vsa.dtype)])
        elif corrections[-1] == 0:
            return _Trained(program, epochs, updates, 0, 0)
        elif not hopeless:
            ends = deque([program])
        # Each correction changes the recall of all pairs, so what is left wrong is only known by asking again.
        outcomes = [pairs.outcome(end) for end in ends]
        best = min(range(len(ends)), key=outcomes.__getitem__)
        return _Trained(ends[best], epochs, updates, *outcomes[best])


class _Trained(NamedTuple):
    """What a training ended with."""

    program: Shaped[Tensor, "d"]
    epochs: int
    updates: int
    wrong: int
    """Pairs recalled wrongly."""
    short: int
    """Pairs out of order: recalled wrongly, or below the margin."""


class _Pairs:
    """The pairs of a training, and what a program answers to them."""

    def __init__(
        self,
        vsa: VSA,
        conditions: Shaped[Tensor, "k d"] | LazyConditions,
        targets: Int64[Tensor, "k"],
        items: Shaped[Tensor, "r d"],
        margin: float,
    ) -> None:
        self.vsa, self.conditions, self.targets, self.items = vsa, conditions, targets, items
        self.readout = vsa.readout(torch.zeros(vsa.dim, dtype=vsa.accumulator, device=items.device), items)
        # The score of one stored pair for itself, by which margins are measured.
        unit = torch.cat([norms(vsa.bind(items[t], c)) ** 2 for c, t in _blocks(conditions, targets)])
        self.wanted = margin * unit / norms(items)[targets]

    def __len__(self) -> int:
        return len(self.targets)

    def judge(
        self, program: Shaped[Tensor, "d"], start: int, size: int
    ) -> tuple[Bool[Tensor, "some"], Int64[Tensor, "some"], Float64[Tensor, "some"]]:
        """Of the block of pairs from `start` on: which are out of order, their rivals, and the rivals' scores."""
        return self._judge(self._scores(program, start, size), start)

    def outcome(self, program: Shaped[Tensor, "d"]) -> tuple[int, int]:
        """How many pairs are recalled wrongly, and how many are out of order."""
        wrong = short = 0
        for start in range(0, len(self), _BLOCK):
            answers = self._scores(program, start, _BLOCK)
            wrong += int((answers.argmax(-1) != self.targets[start : start + _BLOCK]).sum())
            short += int(self._judge(answers, start)[0].sum())
        return wrong, short

    def change(self, pair: int, rival: int | None) -> Shaped[Tensor, "d"]:
        """What sets a pair right: the pair itself, less its condition with the rival result, if there is one."""
        condition = self.conditions[pair]
        change = self.vsa.superpose(self.vsa.bind(self.items[int(self.targets[pair])], condition)[None])
        if rival is not None:
            change = change - self.vsa.superpose(self.vsa.bind(self.items[rival], condition)[None])
        return change

    def _scores(self, program: Shaped[Tensor, "d"], start: int, size: int) -> Float64[Tensor, "some r"]:
        return self.readout.of(program)(self.conditions[start : start + size])

    def _judge(
        self, answers: Float64[Tensor, "some r"], start: int
    ) -> tuple[Bool[Tensor, "some"], Int64[Tensor, "some"], Float64[Tensor, "some"]]:
        rows = slice(start, start + len(answers))
        aims = self.targets[rows, None]
        rival_scores, rivals = answers.scatter(1, aims, -torch.inf).max(-1)
        lead = answers.gather(1, aims)[:, 0] - rival_scores.clamp(min=0)
        return (lead < self.wanted[rows]) | (lead <= 0), rivals, rival_scores


def _hopeless(corrections: Sequence[int], pairs: int, patience: int, epochs: int) -> bool:
    """Whether about a third of the pairs would still be corrected in the last of `epochs`, at the present rate.

    The rate is how the mean of the last `patience` epochs lies below that of as many before. Corrections become rarer
    ever more slowly, so that a straight line promises too much rather than too little. The root of the number of pairs
    allows for chance. These numbers were chosen on random pairs near capacity (d from 64 to 1,000, integer codes of
    four kinds, margins 0, 0.5 and 2); with other seeds, none of 761 runs that converge within 200 epochs was ended,
    and 157 of 286 that do not were.
    """
    if not 2 * patience <= len(corrections) < epochs:
        return False
    now, before = (sum(part) / patience for part in (corrections[-patience:], corrections[-2 * patience : -patience]))
    fall = max(before - now, 0) / patience
    return now - fall * (epochs - len(corrections)) > 0.3 * pairs + pairs**0.5


_BLOCK = 64
"""Pairs asked at once, at most; any number gives the same program where scores are exact."""

_TOLD = 512
"""Pairs visited between two reports of progress within an epoch."""

_ENCODED = 0.1
"""The share of the work that counts as done when all conditions are encoded."""


def _widest(x: Tensor) -> torch.dtype:
    """A type in which sums over all visits are exact, or as exact as may be."""
    if is_integer(x):
        return torch.int64
    return torch.complex128 if x.is_complex() else torch.float64


def _blocks(conditions: Tensor | LazyConditions, targets: Tensor) -> zip:
    return zip(conditions.split(256), targets.split(256), strict=True)
