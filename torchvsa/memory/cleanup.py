"""Clean-up memory: the known item that a noisy hypervector resembles most."""

from collections.abc import Callable
from typing import Any, NamedTuple

import torch
from jaxtyping import Float, Int, Shaped
from torch import Tensor, nn

from torchvsa.errors import ShapeError
from torchvsa.exact import divide, dots, norms


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
    index = scores.argmax(-1)
    top = scores.amax(-1)
    if scores.shape[-1] == 1:
        margin = torch.full_like(top, torch.inf)
    else:
        rivals = scores.scatter(-1, index[..., None], -torch.inf)
        margin = divide(top - rivals.amax(-1), lengths)
    return Match(index, divide(top, lengths).to(torch.float32), margin.to(torch.float32))


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
        scores = divide(dots(queries, self.items).to(torch.float64), self.lengths)
        return best(scores, norms(queries))
