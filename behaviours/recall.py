"""What a behaviour answers."""

from collections.abc import Callable
from typing import Any, NamedTuple

import torch
from jaxtyping import Float, Float64, Int64, Shaped
from torch import Tensor

from behaviours.ordered import distinct_rows
from torchvsa import Readout
from torchvsa._numerics import in_units, inner_products, norms, over_lengths


class Recall(NamedTuple):
    """The answer to a batch of readings. Never a silent guess: it says how sure it is."""

    commands: Float64[Tensor, "batch m"]
    """One command per actuator; NaN where no sensor was observed."""
    similarity: Float[Tensor, "batch"]
    """Cosine of the noisy result with the stored result that won."""
    margin: Float[Tensor, "batch"]
    """How far the runner-up lies below; inf if only one result is known."""
    familiarity: Float[Tensor, "batch"]
    """Cosine of the condition with the sum of the known conditions."""
    speaker: Int64[Tensor, "batch"] | None = None
    """Which behaviour answered: its position in the policy's list of names (policies only)."""

    def rows(self, which: Int64[Tensor, "some"]) -> "Recall":
        """The answers of these rows, in this order."""
        spoken = None if self.speaker is None else self.speaker[which]
        return Recall(self.commands[which], self.similarity[which], self.margin[which], self.familiarity[which], spoken)

    def mask_unobserved(self, rows: Any) -> "Recall":
        """Answer nothing in the given rows: NaN commands; similarity, margin and familiarity 0; speaker -1."""
        return Recall(
            self.commands.masked_fill(rows[:, None], torch.nan),
            self.similarity.masked_fill(rows, 0.0),
            self.margin.masked_fill(rows, 0.0),
            self.familiarity.masked_fill(rows, 0.0),
            None if self.speaker is None else self.speaker.masked_fill(rows, -1),
        )


_MANY = 128
"""Rows from which on it pays to find equal ones."""


def over_unique_rows(answer: Callable[[Shaped[Tensor, "some w"]], Recall], cells: Shaped[Tensor, "batch w"]) -> Recall:
    """`answer(cells)`, asking once about rows that are equal: what a robot reads in a while falls into few cells.

    A graph and a GPU ask about every row, since how many differ is known only from the values.
    """
    if torch.compiler.is_compiling() or cells.device.type != "cpu" or len(cells) < _MANY:
        return answer(cells)
    distinct, which = distinct_rows(cells)
    return answer(distinct).rows(which)


def recalled(
    readout: Readout,
    known: Shaped[Tensor, "d"],
    commands: Float64[Tensor, "k m"],
    conditions: Shaped[Tensor, "batch d"],
) -> Recall:
    """Answer encoded and protected conditions with the best item's row of `commands` (Algorithm 2, lines 2 to 8)."""
    match = readout.match(conditions)
    return Recall(commands[match.index], match.similarity, match.margin, familiarity(conditions, known))


def familiarity(conditions: Shaped[Tensor, "batch d"], known: Shaped[Tensor, "d"]) -> Float[Tensor, "batch"]:
    """The cosine of each condition with the sum of the known ones; 0 where one of them is a zero vector."""
    known, _ = in_units(known)
    products = inner_products(conditions, known[None])[:, 0]
    return over_lengths(products.to(torch.float64), norms(conditions) * norms(known)).to(torch.float32)
