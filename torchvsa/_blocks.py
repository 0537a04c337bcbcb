"""Work on many rows, a block of them at a time."""

from collections.abc import Callable, Iterable
from typing import Any, TypeVar, cast

import torch
from torch import Tensor

CACHE_BYTES = 2**22
"""Fits the second-level cache of common CPUs, where what lies between two steps is read back fast."""
_GPU_BYTES = 2**28
"""Enough to keep a GPU busy, which has no such cache, and little beside its memory."""

Answer = TypeVar("Answer", bound=Tensor | tuple[Any, ...])


def rows_at_once(row_bytes: int, device: torch.device, block_bytes: int = CACHE_BYTES) -> int:
    """Rows of so many bytes in a block. A CPU gains speed from blocks, a GPU memory alone: there they are larger."""
    if device.type != "cpu":
        block_bytes = max(block_bytes, _GPU_BYTES)
    return max(block_bytes // max(row_bytes, 1), 1)


def by_blocks(work: Callable[..., Answer], *rows: Tensor, row_bytes: int, block_bytes: int = CACHE_BYTES) -> Answer:
    """`work(*rows)`, on blocks of rows that take `block_bytes` between steps if one row takes `row_bytes`.

    `work` maps tensors `[N, ...]` to one tensor `[N, ...]`, or a named tuple of them (or None), row by row: the answer
    is the same at any block size. A compiler gets all rows at once.
    """
    count = rows_at_once(row_bytes, rows[0].device, block_bytes)
    if torch.compiler.is_compiling() or len(rows[0]) <= count:
        return work(*rows)
    parts = [work(*some) for some in zip(*(tensor.split(count) for tensor in rows), strict=True)]
    first = parts[0]
    if isinstance(first, Tensor):
        return cast(Any, torch.cat(cast(list[Tensor], parts)))
    columns: Iterable[Any] = zip(*parts, strict=True)
    return cast(Any, type(first))(*(None if column[0] is None else torch.cat(column) for column in columns))
