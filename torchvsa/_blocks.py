"""Work on many rows in blocks."""

from collections.abc import Callable, Iterable
from typing import Any, TypeVar, cast

import torch
from torch import Tensor

CACHE_BYTES = 2**22
"""Fits the second-level cache of common CPUs, so that intermediate results are read back fast."""
_GPU_BYTES = 2**28
"""Enough to keep a GPU busy, and little compared with its memory."""

Answer = TypeVar("Answer", bound=Tensor | tuple[Any, ...])


def rows_at_once(row_bytes: int, device: torch.device, block_bytes: int = CACHE_BYTES) -> int:
    """Rows per block for rows of `row_bytes`. GPU blocks are larger, because there they only bound memory."""
    if device.type != "cpu":
        block_bytes = max(block_bytes, _GPU_BYTES)
    return max(block_bytes // max(row_bytes, 1), 1)


def by_blocks(work: Callable[..., Answer], *rows: Tensor, row_bytes: int, block_bytes: int = CACHE_BYTES) -> Answer:
    """Call `work(*rows)` on blocks of rows and concatenate the answers.

    Under `torch.compile` and `torch.export` there is one block.

    Args:
        work: Maps tensors `[N, ...]` to one tensor `[N, ...]`, or to a named tuple of them or None. Each row of the
            answer depends on that row only, so that the block size does not matter.
        rows: The tensors.
        row_bytes: Memory that `work` takes for one row.
        block_bytes: Memory that it may take for one block.
    """
    count = rows_at_once(row_bytes, rows[0].device, block_bytes)
    if torch.compiler.is_compiling() or len(rows[0]) <= count:
        return work(*rows)
    parts = [work(*block) for block in zip(*(tensor.split(count) for tensor in rows), strict=True)]
    first = parts[0]
    if isinstance(first, Tensor):
        return cast(Any, torch.cat(cast(list[Tensor], parts)))
    columns: Iterable[Any] = zip(*parts, strict=True)
    return cast(Any, type(first))(*(None if column[0] is None else torch.cat(column) for column in columns))
