"""One learned behaviour: a program of d numbers, and what it takes to ask it."""

from typing import Any

import torch
from jaxtyping import Float64, Int64, Shaped
from torch import Tensor, nn

from behaviours.recall import Recall, scores
from behaviours.report import LearningReport
from behaviours.space import Space
from torchvsa import CleanUp, ShapeError
from torchvsa.exact import norms
from torchvsa.memory import best


class Behaviour(nn.Module):
    """A behaviour as one hypervector, `program` `[d]`; called with readings `[B, n]` it answers with commands.

    `known` `[d]` is the sum of the conditions that it knows. `results` `[K, m]` is the clean-up memory as levels of the
    actuators, in order of first insertion; the codes of the levels that it names, again in that order, are
    the clean-up memory of each actuator. All are raw accumulators: see `clipped`.

    Source: Neubert et al. 2016, Algorithm 2.
    """

    program: Tensor
    known: Tensor
    results: Tensor

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
        if results.dim() != 2 or results.shape[1] != len(space.schema.actuators):
            raise ShapeError(
                f"results must be rows of one level per actuator, [k, {len(space.schema.actuators)}]; "
                f"got shape {tuple(results.shape)}"
            )
        self.space = space
        self.report = report
        self.register_buffer("program", program)
        self.register_buffer("known", known)
        self.register_buffer("results", results)

    def forward(self, readings: Any) -> Recall:
        """Commands `[B, m]` for readings `[B, n]`, with similarity, margin and familiarity (see `Recall`).

        Raises an error that names sensor, row and range for readings that are not valid.
        """
        bins = self.space.bins(readings)
        recall = self.ask(self.space.encode(bins))
        return recall.blank((bins < 0).all(-1))

    def ask(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """Answer conditions that are encoded and protected already."""
        return answer(self.space, self.program, self.known, self.results, conditions)

    def clipped(self) -> "Behaviour":
        """A copy whose program and known conditions are hypervectors of the architecture, not raw sums.

        Clipping loses the counts: a program of many pairs recalls far fewer of them afterwards.
        """
        vsa = self.space.vsa
        return Behaviour(self.space, vsa.normalize(self.program), vsa.normalize(self.known), self.results, self.report)


def answer(
    space: Space,
    program: Shaped[Tensor, "d"],
    known: Shaped[Tensor, "d"],
    results: Int64[Tensor, "k m"],
    conditions: Shaped[Tensor, "batch d"],
) -> Recall:
    """Algorithm 2 for a batch of protected conditions."""
    items = space.results(results)
    lengths = space.vsa.unbound_norm(program, conditions)
    match = best(scores(space.vsa, program, conditions, items, norms(items)), lengths)
    commands = decode(space, results, items)[match.index]
    familiarity = space.vsa.similarity(conditions, known)
    return Recall(commands, match.similarity, match.margin, familiarity)


def decode(space: Space, results: Int64[Tensor, "k m"], items: Shaped[Tensor, "k d"]) -> Float64[Tensor, "k m"]:
    """The commands of each stored result (Algorithm 2, lines 4 to 8).

    They depend on the winning result alone, so they are a table: for actuator i the result is unbound from
    its role and compared with the values of that actuator that were stored.
    """
    columns = []
    for actuator in range(results.shape[1]):
        levels = in_order_of_appearance(results[:, actuator])
        values = CleanUp(space.results.codes[levels])
        noisy = space.vsa.unbind(items, space.results.roles[actuator])
        columns.append(levels[values(noisy).index])
    return space.schema.command_values(torch.stack(columns, -1))


def in_order_of_appearance(values: Int64[Tensor, "k"]) -> Int64[Tensor, "distinct"]:
    """The distinct values, each where it first appears."""
    distinct, inverse = values.unique(return_inverse=True)
    first = torch.full((len(distinct),), len(values), device=values.device)
    first = first.scatter_reduce(0, inverse, torch.arange(len(values), device=values.device), "amin")
    return distinct[first.argsort()]
