"""Clean-up memory: the known item that a noisy hypervector resembles most."""

from collections.abc import Callable
from typing import Any, NamedTuple

import torch
from jaxtyping import Float, Int, Shaped
from torch import Tensor, nn

from torchvsa.blocks import by_blocks
from torchvsa.errors import ShapeError
from torchvsa.exact import dots, norms, scaled

_PRODUCT_BYTES = 2**27
"""Products held at once; more queries are answered some at a time."""


class Match(NamedTuple):
    """What a clean-up memory answers, one entry per query."""

    index: Int[Tensor, "*batch"]  # pyright: ignore[reportIncompatibleMethodOverride] (the field's own word for it)
    """The most similar item; equal similarities go to the lowest index."""
    similarity: Float[Tensor, "*batch"]
    """Its cosine with the query."""
    margin: Float[Tensor, "*batch"]
    """How far the runner-up's cosine lies below it; inf for a single item."""


def best(scores: Float[Tensor, "*batch k"], lengths: Float[Tensor, "*batch"]) -> Match:
    """The best of `k` scores (inner products over the items' lengths), as cosines with queries of these lengths."""
    top, index = scores.max(-1)
    if scores.shape[-1] == 1:
        lead = torch.full_like(top, torch.inf)
    else:
        lead = top - scores.scatter(-1, index[..., None], -torch.inf).amax(-1)
    # A query of length 0 has the score 0 with every item.
    lengths = torch.where(lengths > 0, lengths, 1.0)
    return Match(index, (top / lengths).to(torch.float32), (lead / lengths).to(torch.float32))


class CleanUp(nn.Module):
    """Compare queries `[..., d]` with items `[K, d]` by cosine and answer with the best.

    Scores are compared in float64 from exact inner products, so that the answer for integer codes does not
    depend on batch size, threads or device. Raises `ShapeError` without items.

    Source: Neubert et al. 2016, section II.
    """

    items: Tensor
    lengths: Tensor

    def __init__(self, items: Shaped[Tensor, "k d"]) -> None:
        super().__init__()
        if items.dim() != 2 or len(items) == 0:
            raise ShapeError(f"a clean-up memory needs items [K, d] with K at least 1; got shape {tuple(items.shape)}")
        self.register_buffer("items", items)
        self.lengths = norms(items)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "CleanUp":
        # The lengths follow the items wherever they go, but stay in float64 whatever type the items take.
        super()._apply(fn, recurse)
        self.lengths = norms(self.items)
        return self

    def _load_from_state_dict(self, *args: Any, **kwargs: Any) -> None:
        super()._load_from_state_dict(*args, **kwargs)
        self.lengths = norms(self.items)

    def forward(self, queries: Shaped[Tensor, "*batch d"]) -> Match:
        """The index, similarity and margin of the best item for each query."""
        if queries.dim() == 0 or queries.shape[-1] != self.items.shape[-1]:
            raise ShapeError(
                f"queries must end in d = {self.items.shape[-1]} elements; got shape {tuple(queries.shape)}"
            )
        rows = queries.reshape(-1, queries.shape[-1])
        match = by_blocks(self._best, rows, row_bytes=8 * len(self.items), block_bytes=_PRODUCT_BYTES)
        return Match(*(answer.reshape(queries.shape[:-1]) for answer in match))

    def _best(self, rows: Shaped[Tensor, "batch d"]) -> Match:
        # No item wins by the length of the query, so that floats may round it: that is read off in one pass.
        lengths = torch.linalg.vector_norm(rows, dim=-1) if rows.is_floating_point() else norms(rows)
        # The products of many rows are found fastest together, and looked through while in the cache.
        return by_blocks(self._look_through, dots(rows, self.items), lengths, row_bytes=24 * len(self.items))

    def _look_through(self, products: Shaped[Tensor, "batch k"], lengths: Float[Tensor, "batch"]) -> Match:
        return best(scaled(products, self.lengths), lengths)
