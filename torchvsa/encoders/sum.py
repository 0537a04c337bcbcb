"""Records that bundle what the sensors read."""

import torch
from jaxtyping import Bool, Int64, Shaped
from torch import Tensor

from torchvsa._blocks import by_blocks
from torchvsa.encoders.record import Record, places


class Sum(Record):
    """The bundle of the role-bound values. Its kernel **averages** the kernels of the values.

    Source: Neubert et al. 2016, Algorithm 1, line 3.
    """

    name = "sum"

    def _absent(self, like: Shaped[Tensor, "..."]) -> Shaped[Tensor, "d"]:
        # Its weight is zero as well, so that it has no vote.
        return torch.zeros_like(like[0, 0])

    def _join(self, table: Shaped[Tensor, "n entries d"], cells: Int64[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        if not self.vsa.breaks_ties:
            return self.vsa._bundle_entries(table, places(table, cells))
        # The voters themselves decide ties, so they are needed side by side.
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
