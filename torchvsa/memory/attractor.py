"""What memories that complete a query have in common."""

from abc import abstractmethod
from typing import TYPE_CHECKING

import torch
from jaxtyping import Float, Int8, Shaped
from torch import Tensor

from torchvsa._numerics import as_bipolar
from torchvsa.memory.cleanup import CleanUp, Match

if TYPE_CHECKING:
    from torchvsa.architectures.base import VSA


class Attractor(CleanUp):
    """The base of memories that first complete a query, and then look up the most similar item.

    `retrieve` is the completed state; index, similarity and margin are those of `CleanUp` for it. A query of zeros
    stays zero, and one with NaN or infinity is NaN. A new memory implements `_completed`.
    """

    @abstractmethod
    def _completed(self, rows: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
        """The completed state of each row."""

    def retrieve(self, queries: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The completed state of each query. Raises `ShapeError` unless queries end in d elements."""
        self._check_queries(queries)
        rows = as_bipolar(queries.reshape(-1, queries.shape[-1]))
        states = self._completed(rows)
        states = states * (rows != 0).any(-1, keepdim=True)
        return torch.where(rows.isfinite().all(-1, keepdim=True), states, torch.nan).reshape(queries.shape)

    def forward(self, queries: Shaped[Tensor, "*batch d"]) -> Match:
        """The index of the item that is most similar to the completed state, its similarity to it, and its margin."""
        return super().forward(self.retrieve(queries))


class BipolarAttractor(Attractor):
    """The base of those whose items are -1 / +1, or bits. Raises `ValueError` for others."""

    def __init__(self, items: Shaped[Tensor, "k d"]) -> None:
        super().__init__(items)
        if items.is_complex() or not (as_bipolar(items).abs() == 1).all():
            raise ValueError(
                f"{type(self).__name__} holds items of -1 / +1 or bits, as MAP and BSC draw them; got others"
            )

    @staticmethod
    def supports(vsa: "VSA") -> bool:
        """Whether the elements of its hypervectors are -1 / +1, or bits."""
        return vsa.elementwise and vsa.self_inverse and not vsa.dtype.is_complex

    def _bipolar(self) -> Int8[Tensor, "k d"]:
        return as_bipolar(self.items).to(torch.int8)


def signs(rows: Shaped[Tensor, "batch d"]) -> Float[Tensor, "batch d"]:
    """The signs of queries as float32; zeros, of which nothing is known, stay."""
    return torch.nan_to_num(rows).sign().to(torch.float32)
