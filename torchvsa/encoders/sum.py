"""Records that bundle the sensors' readings."""

import torch
from jaxtyping import Bool, Int64, Shaped
from torch import Tensor

from torchvsa._blocks import by_blocks
from torchvsa.architectures._entries import bundle_entries
from torchvsa.encoders.record import Record, entry_indices


class Sum(Record):
    """The bundle of the role-bound values. Its kernel is the **mean** of the kernels of the values.

    Source: Neubert et al. 2016, Algorithm 1, line 3.
    """

    name = "sum"

    def _absent(self, like: Shaped[Tensor, "..."]) -> Shaped[Tensor, "d"]:
        # Its weight is 0 too, so that it has no vote.
        return torch.zeros_like(like[0, 0])

    def _join(self, table: Shaped[Tensor, "n entries d"], cells: Int64[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        if not self.vsa.breaks_ties:
            return bundle_entries(self.vsa, table, entry_indices(table, cells))
        # The summands decide ties, so all of them are needed at once.
        sensors = torch.arange(len(table), device=table.device)
        return by_blocks(
            lambda rows: self._combine(table[sensors, rows], rows >= 0),
            cells,
            row_bytes=len(table) * self.vsa.row_bytes,
        )

    def _combine(
        self, bound: Shaped[Tensor, "batch n d"], observed: Bool[Tensor, "batch n"]
    ) -> Shaped[Tensor, "batch d"]:
        return self.vsa.bundle(bound, weights=observed.int())
