"""The answer of a behaviour or policy."""

from collections.abc import Callable
from typing import Any, NamedTuple

import torch
from jaxtyping import Float, Float64, Int64, Shaped
from torch import Tensor

from behaviours.ordered import distinct_rows
from torchvsa import Readout
from torchvsa._blocks import by_blocks
from torchvsa._numerics import in_units, inner_products, norms, over_lengths


class Recall(NamedTuple):
    """The answer to a batch of readings, with measures of its certainty."""

    commands: Float64[Tensor, "batch m"]
    """One command per actuator; NaN where no sensor was observed."""
    similarity: Float[Tensor, "batch"]
    """Cosine of the unbound, noisy result with the most similar stored result; of a smooth behaviour, with the smooth
    result (taking roles as orthogonal)."""
    margin: Float[Tensor, "batch"]
    """Lead of `similarity` over that of the second most similar result; inf if there is only one, or if smooth."""
    familiarity: Float[Tensor, "batch"]
    """Cosine of the condition with the sum of the known conditions."""
    speaker: Int64[Tensor, "batch"] | None = None
    """Index of the behaviour that answered, in `Policy.names` (policies only)."""

    def rows(self, index: Int64[Tensor, "rows"]) -> "Recall":
        """The answers of these rows, in this order."""
        speaker = None if self.speaker is None else self.speaker[index]
        return Recall(
            self.commands[index], self.similarity[index], self.margin[index], self.familiarity[index], speaker
        )

    def joined(self, other: "Recall") -> "Recall":
        """These answers, followed by those of `other`."""
        mine, more = list(self[:4]), list(other[:4])
        if self.speaker is not None and other.speaker is not None:
            mine, more = [*mine, self.speaker], [*more, other.speaker]
        return Recall(*map(torch.cat, zip(mine, more, strict=True)))

    def mask_unobserved(self, rows: Any) -> "Recall":
        """Replace these rows: commands by NaN; similarity, margin and familiarity by 0; speaker by -1."""
        return Recall(
            self.commands.masked_fill(rows[:, None], torch.nan),
            self.similarity.masked_fill(rows, 0.0),
            self.margin.masked_fill(rows, 0.0),
            self.familiarity.masked_fill(rows, 0.0),
            None if self.speaker is None else self.speaker.masked_fill(rows, -1),
        )


_MIN_ROWS = 128
"""The number of rows from which finding equal ones saves time."""


def over_unique_rows(answer: Callable[[Shaped[Tensor, "rows w"]], Recall], cells: Shaped[Tensor, "batch w"]) -> Recall:
    """Evaluate `answer` on the unique rows of `cells`, and gather the results for all rows.

    A robot reads few distinct cells. Graphs and GPUs evaluate every row, since the number of unique rows depends on the
    values.
    """
    if torch.compiler.is_compiling() or cells.device.type != "cpu" or len(cells) < _MIN_ROWS:
        return answer(cells)
    unique, index = distinct_rows(cells)
    return answer(unique).rows(index)


def answer_conditions(
    readout: Readout,
    known: Shaped[Tensor, "d"],
    commands: Float64[Tensor, "k m"],
    conditions: Shaped[Tensor, "batch d"],
    smooth: bool = False,
) -> Recall:
    """The answer to encoded and protected conditions (Algorithm 2, lines 2 to 8).

    Args:
        readout: The program and the items of the clean-up memory; if smooth, the roles of the actuators.
        known: The sum of the known conditions.
        commands: The commands of each item; if smooth, the lowest and the highest command of each actuator.
        conditions: Encoded and protected conditions.
        smooth: Whether commands are the scores of the roles, see `Behaviour`, instead of those of the best item.
    """
    if smooth:
        scores = readout(conditions)
        low, high = commands
        values = torch.minimum(low + (scores.clamp(-1, 1) + 1) / 2 * (high - low), high)
        noise = readout.noise(conditions)
        noise = noise if readout.units is None else noise * readout.units.to(torch.float64)
        similarity = over_lengths(scores.norm(dim=-1), noise).clamp(max=1).to(torch.float32)
        margin = torch.full_like(similarity, torch.inf)
        return Recall(values, similarity, margin, familiarity(conditions, known))
    match = readout.match(conditions)
    return Recall(commands[match.index], match.similarity, match.margin, familiarity(conditions, known))


def answer_cells(
    encode: Callable[[Shaped[Tensor, "batch w"]], Shaped[Tensor, "batch d"]],
    readout: Readout,
    known: Shaped[Tensor, "d"],
    commands: Float64[Tensor, "k m"],
    cells: Shaped[Tensor, "batch w"],
    smooth: bool = False,
) -> Recall:
    """The answer to cells, which `encode` maps to conditions; see `answer_conditions`."""
    # Each block of rows is processed to the end, so that its conditions, in float64, stay in the cache.
    return by_blocks(
        lambda rows: answer_conditions(readout, known, commands, encode(rows), smooth), cells, row_bytes=8 * len(known)
    )


def familiarity(conditions: Shaped[Tensor, "batch d"], known: Shaped[Tensor, "d"]) -> Float[Tensor, "batch"]:
    """The cosine of each condition with the sum of the known conditions; 0 for zero vectors."""
    known, _ = in_units(known)
    products = inner_products(conditions, known[None])[:, 0]
    return over_lengths(products.to(torch.float64), norms(conditions) * norms(known)).to(torch.float32)
