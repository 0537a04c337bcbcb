"""Correct the program where its recall is wrong."""

from dataclasses import dataclass

import torch
from torch import Tensor

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule, grown
from behaviours.learning.conditions import Conditions
from behaviours.learning.samples import Contradictions, Samples, check_contradictions
from behaviours.progress import Progress, silent
from behaviours.recall import scores
from behaviours.space import Space
from torchvsa import VSA
from torchvsa.exact import is_integer, norms, signed


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

    `contradictions` decides for a condition shown with several results: the `"first"` (as the paper does),
    the `"majority"` (the first among equals), or the `"latest"`.

    Source: the perceptron (Rosenblatt 1958), in hyperdimensional computing e.g. AdaptHD (Imani et al. 2019);
    its average, Freund and Schapire 1999, "Large margin classification using the perceptron algorithm".
    """

    name = "error_driven"
    incremental = True

    margin: float = 0.5
    passes: int = 200
    contradictions: Contradictions = "majority"
    average: bool = False

    def __post_init__(self) -> None:
        check_contradictions(self.contradictions)
        if self.margin < 0 or self.passes < 1:
            raise ValueError(f"margin is at least 0 and passes at least 1; got {self.margin} and {self.passes}")

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = silent) -> Behaviour:
        """See `Rule.fit`."""
        return self._learn(space, Samples.of(space, demonstrations), progress=progress)

    def partial_fit(self, behaviour: Behaviour, demonstrations: Demonstrations) -> Behaviour:
        """See `Rule.partial_fit`: the pairs of this piece are set right, from the program at hand on.

        Earlier pairs are not visited again, and later corrections may disturb them.
        """
        samples = Samples.of(behaviour.space, demonstrations).after(behaviour.results)
        return self._learn(behaviour.space, samples, behaviour)

    def _learn(
        self, space: Space, samples: Samples, before: Behaviour | None = None, progress: Progress = silent
    ) -> Behaviour:
        targets = samples.targets(self.contradictions)
        items = space.items(samples.results)
        trained = self._train(space.vsa, samples.conditions, targets, items, before, progress)
        program, passes, updates, wrong = trained
        progress(1.0)
        report = samples.report(
            self.name,
            contradicting=int((targets[samples.condition] != samples.result).sum()),
            passes=passes,
            updates=updates,
            wrong=wrong,
        )
        return grown(before, Behaviour(space, program, samples.known(space.vsa), samples.results, report))

    def _train(
        self,
        vsa: VSA,
        conditions: Tensor | Conditions,
        targets: Tensor,
        items: Tensor,
        before: Behaviour | None,
        progress: Progress,
    ) -> tuple[Tensor, int, int, int]:
        """The sequential perceptron: the pairs are visited in order, and each sees all corrections before it."""
        lengths = norms(items)
        # The score of one stored pair for itself, by which margins are measured.
        unit = torch.cat([norms(vsa.bind(c, items[t])) ** 2 for c, t in _blocks(conditions, targets)])
        wanted = self.margin * unit / lengths[targets]
        program = torch.zeros(vsa.dim, dtype=vsa.accumulator, device=items.device)
        if before is not None:
            program = program + signed(before.program).detach()
        # Each correction times the visits before it: what the mean over all visits lacks of it.
        late = torch.zeros_like(program, dtype=_widest(program))
        updates = sweep = corrected = 0

        def judge(start: int) -> tuple[Tensor, Tensor, Tensor]:
            """Of the block of pairs from `start` on: which are out of order, their rivals, and the rivals' scores."""
            rows = slice(start, start + _BLOCK)
            answers = scores(vsa, program, conditions[rows], items, lengths)
            aims = targets[rows, None]
            rival_scores, rivals = answers.scatter(1, aims, -torch.inf).max(-1)
            lead = answers.gather(1, aims)[:, 0] - rival_scores.clamp(min=0)
            return (lead < wanted[rows]) | (lead <= 0), rivals, rival_scores

        for sweep in range(1, self.passes + 1):
            corrected = start = 0
            while start < len(conditions):
                # Pairs up to the first one out of order leave the program as it is, so a block of them is
                # asked at once; the block after a correction starts behind it.
                short, rivals, rival_scores = judge(start)
                if not short.any():
                    start += _BLOCK
                    continue
                at = int(short.to(torch.int8).argmax())
                condition, aim, rival = conditions[start + at], int(targets[start + at]), int(rivals[at])
                change = vsa.superpose(vsa.bind(condition, items[aim])[None])
                if rival_scores[at] > 0:
                    change = change - vsa.superpose(vsa.bind(condition, items[rival])[None])
                program = program + change
                if self.average:
                    late = late + ((sweep - 1) * len(conditions) + start + at) * change.to(late.dtype)
                corrected += 1
                start += at + 1
            updates += corrected
            if corrected == 0:
                break
            progress(sweep / self.passes)
        if self.average:
            visits = sweep * len(conditions)
            mean = (program.to(late.dtype) * visits - late) / torch.tensor(visits, dtype=torch.float64)
            program = mean.to(torch.float32 if vsa.integer else vsa.dtype)
        elif corrected == 0:
            return program, sweep, updates, 0
        # Each correction changes the recall of all pairs, so what is left wrong is only known by asking again.
        wrong = sum(int(judge(start)[0].sum()) for start in range(0, len(conditions), _BLOCK))
        return program, sweep, updates, wrong


_BLOCK = 64
"""Pairs asked at once; any number gives the same program where scores are exact."""


def _widest(x: Tensor) -> torch.dtype:
    """A type in which sums over all visits are exact, or as exact as may be."""
    if is_integer(x):
        return torch.int64
    return torch.complex128 if x.is_complex() else torch.float64


def _blocks(conditions: Tensor | Conditions, targets: Tensor) -> zip:
    return zip(conditions.split(256), targets.split(256), strict=True)
