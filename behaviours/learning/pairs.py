"""The pairs that a perceptron is trained on, and how a program scores them."""

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float64, Int64, Shaped
from torch import Tensor

from behaviours.learning.conditions import LazyConditions
from behaviours.learning.samples import Samples
from torchvsa import VSA, Readout
from torchvsa._numerics import as_bipolar, norms


class Verdict(NamedTuple):
    """What to do about each pair of a block."""

    short: Bool[Tensor, "rows"]
    """Whether the pair has to be corrected."""
    add: Int64[Tensor, "rows"]
    """The result whose pair is then added; -1 for none."""
    subtract: Int64[Tensor, "rows"]
    """The result whose pair is then subtracted; -1 for none."""


class Pairs:
    """The pairs of conditions and target results, followed by the conditions on which the program is to be silent.

    Args:
        vsa: The architecture.
        samples: The conditions of the pairs, and the silent ones.
        targets: The index of each condition's result.
        items: The hypervectors of the results.
        margins: The lead that each pair needs, in units of the score that a stored pair gives itself.
    """

    def __init__(
        self,
        vsa: VSA,
        samples: Samples,
        targets: Int64[Tensor, "k"],
        items: Shaped[Tensor, "r d"],
        margins: Float64[Tensor, "k"],
    ) -> None:
        self.vsa, self.conditions, self.targets, self.items = vsa, samples.conditions, targets, items
        self.silent = items[:0] if samples.silent is None else samples.silent
        self.readout = vsa.readout(torch.zeros(vsa.dim, dtype=vsa.accumulator, device=items.device), items)
        self.required_lead = margins * self._units(self.conditions, targets)
        self.loudest = _SILENCE * self._units(self.silent, targets.new_zeros(len(self.silent)))

    def __len__(self) -> int:
        return len(self.targets) + len(self.silent)

    def judge(self, readout: Readout, start: int, size: int) -> Verdict:
        """The verdict about up to `size` pairs from `start` on."""
        known = len(self.targets)
        if start < known:
            return self._judge(readout(self.conditions[start : min(start + size, known)]), start)
        return self._judge_silent(readout(self.silent[start - known : start - known + size]), start - known)

    def outcome(self, program: Shaped[Tensor, "d"]) -> tuple[int, int]:
        """The number of pairs recalled wrongly, and of those that are to be corrected."""
        wrong, short, readout = 0, 0, self.readout.of(program)
        for start in range(0, len(self.targets), BLOCK):
            scores = readout(self.conditions[start : start + BLOCK])
            wrong += int((scores.argmax(-1) != self.targets[start : start + BLOCK]).sum())
            short += int(self._judge(scores, start).short.sum())
        for start in range(0, len(self.silent), BLOCK):
            short += int(self._judge_silent(readout(self.silent[start : start + BLOCK]), start).short.sum())
        return wrong, short

    def change(self, pair: int, add: int, subtract: int) -> Shaped[Tensor, "d"]:
        """The correction of a pair: its condition bound with the result `add`, less that with `subtract`."""
        known = len(self.targets)
        condition = self.conditions[pair] if pair < known else self.silent[pair - known]
        if add < 0:
            return -self._bound(condition, subtract)
        change = self._bound(condition, add)
        return change if subtract < 0 else change - self._bound(condition, subtract)

    def _bound(self, condition: Shaped[Tensor, "d"], result: int) -> Shaped[Tensor, "d"]:
        return as_bipolar(self.vsa.bind(self.items[result], condition)).to(self.vsa.accumulator)

    def _judge(self, scores: Float64[Tensor, "rows r"], start: int) -> Verdict:
        rows = slice(start, start + len(scores))
        targets = self.targets[rows]
        rival_scores, rivals = scores.scatter(1, targets[:, None], -torch.inf).max(-1)
        lead = scores.gather(1, targets[:, None])[:, 0] - rival_scores.clamp(min=0)
        short = (lead < self.required_lead[rows]) | (lead <= 0)
        return Verdict(short, targets, rivals.masked_fill(rival_scores <= 0, -1))

    def _judge_silent(self, scores: Float64[Tensor, "rows r"], start: int) -> Verdict:
        """Whether any result is too loud, be it for or against it; the loudest one is corrected."""
        loudness, result = scores.abs().max(-1)
        positive = scores.gather(1, result[:, None])[:, 0] > 0
        short = loudness > self.loudest[start : start + len(scores)]
        return Verdict(short, result.masked_fill(positive, -1), result.masked_fill(~positive, -1))

    def _units(
        self, conditions: Shaped[Tensor, "k d"] | LazyConditions, results: Int64[Tensor, "k"]
    ) -> Float64[Tensor, "k"]:
        """The score that the pair of each condition and result gives itself when it is stored once."""
        blocks = zip(conditions.split(_ROWS), results.split(_ROWS), strict=True)
        squares = [norms(self.vsa.bind(self.items[result], condition)) ** 2 for condition, result in blocks]
        return torch.cat(squares) / norms(self.items)[results]


_SILENCE = 0.5
"""The loudest score that counts as silence, in units of a stored pair; corrections are steps of 1."""

BLOCK = 64
"""The most pairs scored in one call; where scores are exact, any number gives the same program."""

_ROWS = 256
"""Pairs bound in one call when margins are computed; bounds the memory."""
