"""The distinct conditions of a demonstration: held as hypervectors, or encoded whenever they are asked for."""

from collections.abc import Iterator
from typing import Any

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from behaviours.ordered import distinct_rows, first_rows
from behaviours.progress import Progress, no_progress
from behaviours.space import Space
from torchvsa._numerics import inner_products, real_parts

HELD_BYTES = 2**27
"""Conditions that take no more are held as hypervectors."""
_ROWS = 2048
"""Conditions encoded at once, where not all of them are held."""
_PRINTS = 8
"""Numbers in a fingerprint."""


class LazyConditions:
    """`k` conditions of which the cells alone are held; indexed like a tensor `[k, d]`, it encodes what is asked for.

    A million conditions of d = 4,000 bytes would take 4 GB, their cells a twentieth of it.
    """

    def __init__(self, space: Space, cells: Shaped[Tensor, "k w"]) -> None:
        self.space, self.cells = space, cells

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def device(self) -> torch.device:
        """Where they are encoded."""
        return self.cells.device

    def __getitem__(self, index: Any) -> Shaped[Tensor, "*some d"]:
        rows = self.cells[index]
        return self.space.encode(rows[None])[0] if rows.dim() == 1 else self.space.encode(rows)

    def index_select(self, dim: int, index: Int64[Tensor, "some"]) -> Shaped[Tensor, "some d"]:
        """The conditions with these numbers (`dim` is 0)."""
        return self[index]

    def split(self, size: int) -> Iterator[Shaped[Tensor, "some d"]]:
        """All of them in order, `size` at a time."""
        return (self.space.encode(rows) for rows in self.cells.split(size))


def encode_distinct(
    space: Space, cells: Shaped[Tensor, "N w"], progress: Progress = no_progress
) -> tuple["Shaped[Tensor, 'k d'] | LazyConditions", Int64[Tensor, "N"]]:
    """The distinct conditions of these rows, in order of first appearance, and which of them each row has.

    Conditions are the same if their hypervectors are. Rows of equal cells are found first, and only one of each is
    encoded. `progress` is told the share that is done.
    """
    distinct, condition = distinct_rows(cells)
    if len(distinct) * space.vsa.row_bytes <= HELD_BYTES:
        encoded, merged = distinct_rows(space.encode(distinct))
        progress(1.0)
        return encoded, merged[condition]
    first, merged = _merged(space, distinct, progress)
    return LazyConditions(space, distinct if len(first) == len(distinct) else distinct[first]), merged[condition]


def _merged(
    space: Space, cells: Shaped[Tensor, "k w"], progress: Progress
) -> tuple[Int64[Tensor, "c"], Int64[Tensor, "k"]]:
    """The row in which each distinct hypervector appears first, and for each row which of them it has.

    Hypervectors are compared by fingerprints, and equal ones then in full.
    """
    seed = 0
    while True:
        # Written into one tensor: many small ones, each behind a large one that is free again, keep memory in pieces.
        done, prints = 0, torch.empty(len(cells), _PRINTS, dtype=torch.int64, device=cells.device)
        for rows, into in zip(cells.split(_ROWS), prints.split(_ROWS), strict=True):
            into.copy_(_fingerprints(space.encode(rows), seed))
            done += len(rows)
            progress(done / len(cells))
        _, merged = distinct_rows(prints)
        first = first_rows(merged)
        later = (first[merged] != torch.arange(len(cells), device=cells.device)).nonzero()[:, 0]
        same = (
            torch.equal(space.encode(cells[some]), space.encode(cells[first[merged[some]]]))
            for some in later.split(_ROWS)
        )
        if all(same):
            return first, merged
        seed += 1  # all but impossible: other fingerprints tell them apart


def _fingerprints(conditions: Shaped[Tensor, "some d"], seed: int) -> Int64[Tensor, "some prints"]:
    """Random sums of each hypervector's bytes."""
    real = real_parts(conditions)
    # Adding zero leaves no -0.0, which equals 0.0 but has other bytes.
    content = (real + 0.0 if real.is_floating_point() else real).contiguous().view(torch.int8)
    generator = torch.Generator().manual_seed(seed)
    keys = torch.randint(-127, 128, (_PRINTS, content.shape[1]), dtype=torch.int8, generator=generator)
    return inner_products(content, keys.to(content.device)).to(torch.int64)
