"""The distinct conditions of demonstrations: kept as hypervectors, or encoded again on each access."""

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
"""Conditions are kept as hypervectors up to this size."""
_ROWS = 2048
"""Conditions encoded in one call where not all of them are kept; bounds the memory."""
_PRINTS = 8
"""Numbers per fingerprint."""


class LazyConditions:
    """`k` conditions, indexed like a tensor `[k, d]`, that keeps only their cells and encodes on access.

    A million conditions of d = 4,000 bytes take 4 GB; their cells take a twentieth of that.
    """

    def __init__(self, space: Space, cells: Shaped[Tensor, "k w"]) -> None:
        self.space, self.cells = space, cells

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def device(self) -> torch.device:
        """The device of the conditions."""
        return self.cells.device

    def __getitem__(self, index: Any) -> Shaped[Tensor, "*rows d"]:
        rows = self.cells[index]
        return self.space.encode(rows[None])[0] if rows.dim() == 1 else self.space.encode(rows)

    def index_select(self, dim: int, index: Int64[Tensor, "rows"]) -> Shaped[Tensor, "rows d"]:
        """The conditions at these indices; `dim` must be 0."""
        return self[index]

    def split(self, size: int) -> Iterator[Shaped[Tensor, "rows d"]]:
        """Chunks of up to `size` conditions, in order."""
        return (self.space.encode(rows) for rows in self.cells.split(size))


def encode_distinct(
    space: Space, cells: Shaped[Tensor, "N w"], progress: Progress = no_progress
) -> tuple["Shaped[Tensor, 'k d'] | LazyConditions", Int64[Tensor, "N"]]:
    """The distinct conditions of these rows, in order of first appearance, and the index of each row's condition.

    Conditions are equal if their hypervectors are. Each distinct row of cells is encoded once.
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
    """The first row of each distinct hypervector, and for each row the index of its hypervector.

    Hypervectors are compared by fingerprint; those with equal fingerprints are then compared in full.
    """
    seed = 0
    while True:
        # One preallocated tensor: many small ones between large temporary ones would fragment the memory.
        encoded, prints = 0, torch.empty(len(cells), _PRINTS, dtype=torch.int64, device=cells.device)
        for rows, into in zip(cells.split(_ROWS), prints.split(_ROWS), strict=True):
            into.copy_(_fingerprints(space.encode(rows), seed))
            encoded += len(rows)
            progress(encoded / len(cells))
        _, merged = distinct_rows(prints)
        first = first_rows(merged)
        later = (first[merged] != torch.arange(len(cells), device=cells.device)).nonzero()[:, 0]
        equal = (
            torch.equal(space.encode(cells[rows]), space.encode(cells[first[merged[rows]]]))
            for rows in later.split(_ROWS)
        )
        if all(equal):
            return first, merged
        seed += 1  # practically impossible: different hypervectors with equal fingerprints


def _fingerprints(conditions: Shaped[Tensor, "rows d"], seed: int) -> Int64[Tensor, "rows prints"]:
    """Random sums of each hypervector's bytes."""
    real = real_parts(conditions)
    # Adding zero turns -0.0 into 0.0, which is equal but has other bytes.
    content = (real + 0.0 if real.is_floating_point() else real).contiguous().view(torch.int8)
    generator = torch.Generator().manual_seed(seed)
    keys = torch.randint(-127, 128, (_PRINTS, content.shape[1]), dtype=torch.int8, generator=generator)
    return inner_products(content, keys.to(content.device)).to(torch.int64)
