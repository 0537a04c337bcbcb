"""Clean-up memory: find the item that is most similar to a noisy hypervector."""

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import torch
from jaxtyping import Float, Int, Shaped
from torch import Tensor, nn

from torchvsa._blocks import by_blocks
from torchvsa._checks import readable
from torchvsa._numerics import in_range, inner_products, norms, ordinary, over_lengths, units, widened
from torchvsa.errors import ShapeError

if TYPE_CHECKING:
    from torchvsa.architectures.base import VSA

_PRODUCT_BYTES = 2**27
"""Memory for products; more queries are answered in blocks."""


class Match(NamedTuple):
    """The answer of a clean-up memory, one entry per query."""

    index: Int[Tensor, "*batch"]  # pyright: ignore[reportIncompatibleMethodOverride] (the field's own word for it)
    """The most similar item; equal similarities go to the lowest index."""
    similarity: Float[Tensor, "*batch"]
    """Its cosine with the query."""
    margin: Float[Tensor, "*batch"]
    """The similarity minus that of the second best item; inf for a single item."""


def best(scores: Float[Tensor, "*batch k"], lengths: Float[Tensor, "*batch"]) -> Match:
    """The best of `k` scores (inner products divided by the items' lengths) for queries of these lengths."""
    top, index = scores.max(-1)
    if scores.shape[-1] == 1:
        lead = torch.where(top.isnan(), top, torch.inf)
    else:
        lead = top - scores.scatter(-1, index[..., None], -torch.inf).amax(-1)
    # A query of length 0 has the score 0 with every item.
    lengths = torch.where(lengths == 0, 1.0, lengths)
    return Match(index, (top / lengths).to(torch.float32), (lead / lengths).to(torch.float32))


class CleanUp(nn.Module):
    """Find the item of `[K, d]` with the largest cosine to each query of `[..., d]`.

    Products of integers are exact and compared in float64, so that the answer does not depend on batch size, threads or
    device. Products of floats are computed in their own type, at least float32; lengths of items, quotients and
    comparisons in float64. Answers do not depend on the scale of queries and items, however large or small.

    A query with a NaN or infinite element has a similarity and margin of NaN, and a meaningless index. Items with one
    raise `ValueError` on a CPU; on another device, in graphs and under `vmap` all similarities are NaN instead.

    The lengths of `items` are computed at each call, so `items` may be changed. Raises `ShapeError` without items.

    Source: Neubert et al. 2016, section II.
    """

    items: Tensor

    def __init__(self, items: Shaped[Tensor, "k d"]) -> None:
        super().__init__()
        if items.dim() != 2 or items.numel() == 0:
            raise ShapeError(
                f"a clean-up memory needs items [K, d] with K and d at least 1; got shape {tuple(items.shape)}"
            )
        self.register_buffer("items", items)

    @staticmethod
    def supports(vsa: "VSA") -> bool:
        """Whether the memory holds hypervectors of this architecture: of every one."""
        return True

    def forward(self, queries: Shaped[Tensor, "*batch d"]) -> Match:
        """The index, similarity and margin of the best item for each query."""
        self._check_queries(queries)
        items, lengths = self._in_range()
        rows = queries.reshape(-1, queries.shape[-1])
        best_of = partial(_best, items=items, lengths=lengths)
        match = by_blocks(best_of, rows, row_bytes=8 * len(items), block_bytes=_PRODUCT_BYTES)
        return Match(*(answer.reshape(queries.shape[:-1]) for answer in match))

    def _check_queries(self, queries: Tensor) -> None:
        if queries.dim() == 0 or queries.shape[-1] != self.items.shape[-1]:
            raise ShapeError(
                f"queries must end in d = {self.items.shape[-1]} elements; got shape {tuple(queries.shape)}"
            )

    def _in_range(self) -> tuple[Shaped[Tensor, "k d"], Float[Tensor, "k"]]:
        if self.items.dtype == torch.int8:
            return self.items, norms(self.items)
        items, lengths, _ = in_range(self.items)
        if readable(lengths) and (wrong := lengths.isnan()).any():
            raise ValueError(f"items must be finite; item {wrong.nonzero()[0].item()} holds NaN or infinity")
        return items, lengths


def _best(rows: Shaped[Tensor, "batch d"], items: Shaped[Tensor, "k d"], lengths: Float[Tensor, "k"]) -> Match:
    rows, row_lengths = _measured(rows)
    # One large product is fastest; its rows are compared in blocks that fit the cache.
    work = partial(_compare, items=lengths)
    return by_blocks(work, inner_products(rows, items), row_lengths, row_bytes=24 * len(items))


def _measured(rows: Shaped[Tensor, "batch d"]) -> tuple[Shaped[Tensor, "batch d"], Float[Tensor, "batch"]]:
    """Queries scaled so that products do not overflow, and their lengths."""
    if rows.dtype == torch.int8:
        return rows, norms(rows)
    rows = widened(rows)
    if not rows.is_floating_point():
        return in_range(rows)[:2]
    # The length of a query does not change which item is best, so a rounded one will do, in one pass.
    lengths = torch.linalg.vector_norm(rows, dim=-1)
    if ordinary(lengths):
        return rows, lengths
    rows = rows / units(rows)
    return rows, torch.linalg.vector_norm(rows, dim=-1)


def _compare(products: Shaped[Tensor, "batch k"], rows: Float[Tensor, "batch"], items: Float[Tensor, "k"]) -> Match:
    return best(over_lengths(products, items), rows)
