"""One learned behaviour: a program of d numbers, and what it takes to ask it."""

from typing import Any

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor, nn

from behaviours.memory import ResultMemory
from behaviours.recall import Recall, scores
from behaviours.report import LearningReport
from behaviours.space import Space
from torchvsa import ShapeError
from torchvsa.exact import divide, dots, norms
from torchvsa.memory import best


class Behaviour(nn.Module):
    """A behaviour as one hypervector, `program` `[d]`; called with readings `[B, n]` it answers with commands.

    `known` `[d]` is the sum of the conditions that it knows; both are raw accumulators, see `clipped`. `memory`
    holds the results that it can answer with.

    Source: Neubert et al. 2016, Algorithm 2.
    """

    program: Tensor
    known: Tensor

    def __init__(
        self,
        space: Space,
        program: Shaped[Tensor, "d"],
        known: Shaped[Tensor, "d"],
        results: Int64[Tensor, "k m"],
        report: LearningReport,
    ) -> None:
        super().__init__()
        for name, vector in (("program", program), ("known", known)):
            if vector.shape != (space.vsa.dim,):
                raise ShapeError(f"{name} must be one hypervector [{space.vsa.dim}]; got shape {tuple(vector.shape)}")
        self.space = space
        self.report = report
        self.register_buffer("program", program)
        self.register_buffer("known", known)
        self.memory = ResultMemory(space, results)

    @property
    def results(self) -> Int64[Tensor, "k m"]:
        """The stored results as levels of the actuators, in order of first insertion."""
        return self.memory.levels

    def forward(self, readings: Any) -> Recall:
        """Commands `[B, m]` for readings `[B, n]`, with similarity, margin and familiarity (see `Recall`).

        Raises an error that names sensor, row and range for readings that are not valid.
        """
        bins = self.space.bins(readings)
        recall = self.ask(self.space.encode(bins))
        return recall.blank((bins < 0).all(-1))

    def ask(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """Answer conditions that are encoded and protected already (Algorithm 2, lines 2 to 8)."""
        vsa, items = self.space.vsa, self.memory.items
        match = best(
            scores(vsa, self.program, conditions, items, norms(items)), vsa.unbound_norm(self.program, conditions)
        )
        resemblance = dots(conditions, self.known[None])[..., 0]
        familiarity = divide(resemblance, norms(conditions) * norms(self.known)).to(torch.float32)
        return Recall(self.memory.commands[match.index], match.similarity, match.margin, familiarity)

    def clipped(self) -> "Behaviour":
        """A copy whose program and known conditions are hypervectors of the architecture, not raw sums.

        Clipping loses the counts: a program of many pairs recalls far fewer of them afterwards.
        """
        vsa = self.space.vsa
        return Behaviour(self.space, vsa.normalize(self.program), vsa.normalize(self.known), self.results, self.report)
