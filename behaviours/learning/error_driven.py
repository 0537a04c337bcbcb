"""Correct the program where its recall is wrong."""

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule
from behaviours.learning.samples import Samples
from behaviours.recall import scores
from behaviours.report import LearningReport
from behaviours.space import Space
from torchvsa.exact import norms


@dataclass(frozen=True)
class ErrorDriven(Rule):
    """Go through the pairs until each is recalled with a margin, adding a pair where it is not.

    A pair is in order if its result scores higher than every other stored result, and than silence (score 0,
    the answer to a condition that was never met), by `margin` times the score that one stored pair gives
    itself. Otherwise the pair is added once more, and the rival result, if there is one, is taken away from
    that condition. The reference to silence matters when programs are added: it makes a behaviour that knows
    one result only speak up as clearly as the others.

    The program stays one raw sum of d numbers; integers for integer codes.

    `contradictions` decides for a condition shown with several results: the `"first"` (as the paper does),
    the `"majority"` (the first among equals), or the `"latest"`.

    Source: the perceptron (Rosenblatt 1958), in hyperdimensional computing e.g. AdaptHD (Imani et al. 2019).
    """

    name = "error_driven"

    margin: float = 0.5
    passes: int = 200
    contradictions: Literal["first", "majority", "latest"] = "majority"

    def __post_init__(self) -> None:
        if self.contradictions not in ("first", "majority", "latest"):
            raise ValueError(
                f"contradictions are settled by 'first', 'majority' or 'latest'; got {self.contradictions!r}"
            )
        if self.margin < 0 or self.passes < 1:
            raise ValueError(f"margin is at least 0 and passes at least 1; got {self.margin} and {self.passes}")

    def fit(self, space: Space, demonstrations: Demonstrations) -> Behaviour:
        """See `Rule.fit`."""
        samples = Samples.of(space, demonstrations)
        targets = self._targets(samples)
        items = space.results(samples.results)
        program, passes, updates, wrong = self._train(space, samples.conditions, targets, items)
        report = LearningReport(
            self.name,
            samples=len(samples.condition),
            new=len(samples.conditions),
            truly_known=len(samples.condition) - len(samples.conditions),
            contradicting=int((targets[samples.condition] != samples.result).sum()),
            passes=passes,
            updates=updates,
            wrong=wrong,
        )
        return Behaviour(space, program, samples.known(space.vsa), samples.results, report)

    def _targets(self, samples: Samples) -> Tensor:
        """The result that each condition shall have."""
        conditions, results = len(samples.conditions), len(samples.results)
        rows = torch.arange(len(samples.condition))
        if self.contradictions == "majority":
            cells = samples.condition * results + samples.result
            counts = torch.bincount(cells, minlength=conditions * results).view(conditions, results)
            first = torch.full_like(counts.view(-1), len(rows)).scatter_reduce(0, cells, rows, "amin")
            leaders = counts == counts.amax(-1, keepdim=True)
            return torch.where(leaders, first.view_as(counts), len(rows)).argmin(-1)
        pick = "amin" if self.contradictions == "first" else "amax"
        chosen = torch.zeros(conditions, dtype=torch.int64)
        chosen = chosen.scatter_reduce(0, samples.condition, rows, pick, include_self=False)
        return samples.result[chosen]

    def _train(self, space: Space, conditions: Tensor, targets: Tensor, items: Tensor) -> tuple[Tensor, int, int, int]:
        """The sequential perceptron: the pairs are visited in order, and each sees all corrections before it."""
        vsa = space.vsa
        lengths = norms(items)
        # The score of one stored pair for itself, by which margins are measured.
        unit = torch.cat([norms(vsa.bind(c, items[t])) ** 2 for c, t in _blocks(conditions, targets)])
        wanted = self.margin * unit / lengths[targets]
        program = torch.zeros(vsa.dim, dtype=vsa.accumulator, device=items.device)
        updates = 0

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
                program = program + vsa.superpose(vsa.bind(condition, items[aim])[None])
                if rival_scores[at] > 0:
                    program = program - vsa.superpose(vsa.bind(condition, items[rival])[None])
                corrected += 1
                start += at + 1
            updates += corrected
            if corrected == 0:
                return program, sweep, updates, 0
        # Each correction changes the recall of all pairs, so what is left wrong is only known by asking again.
        wrong = sum(int(judge(start)[0].sum()) for start in range(0, len(conditions), _BLOCK))
        return program, self.passes, updates, wrong


_BLOCK = 64
"""Pairs asked at once; any number gives the same program where scores are exact."""


def _blocks(conditions: Tensor, targets: Tensor) -> zip:
    return zip(conditions.split(256), targets.split(256), strict=True)
