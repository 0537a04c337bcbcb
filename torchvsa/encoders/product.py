"""Records that bind the sensors' readings."""

from collections.abc import Mapping
from functools import reduce

import torch
from jaxtyping import Bool, Int64, Shaped
from torch import Tensor

from torchvsa.architectures._entries import bind_entries
from torchvsa.encoders.record import Record, entry_indices
from torchvsa.part import Layout


class Product(Record):
    """The product of the role-bound values. Its kernel **multiplies** the kernels of the values.

    If binding commutes, a product of roles and shared values does not tell which sensor has which value. Therefore the
    i-th role-bound value is permuted i times. Convolutions and shifts commute with rotations too, and small
    matrices nearly commute with each other, so architectures whose binding is not element-wise put the elements (or
    blocks, see `VSA.blocks`) of each sensor but the first into a random order instead.
    """

    name = "product"
    arrangement: Tensor

    @property
    def _reorders(self) -> bool:
        return not self.vsa.elementwise

    def own_layout(self) -> Layout:
        """`roles` `[n, d]`, and `arrangement` `[n, d]`, an order of the dimensions, if binding is not element-wise."""
        layout = super().own_layout()
        shape = self.sensors, self.vsa.dim
        return layout | {"arrangement": (torch.int64, shape)} if self._reorders else layout

    def check(self) -> None:
        """Raise `ValueError` unless roles are hypervectors and each arrangement is a permutation."""
        super().check()
        if self._reorders:
            ordered = self.arrangement.sort(-1).values
            if not (ordered == torch.arange(self.vsa.dim, device=ordered.device)).all():
                raise ValueError("arrangement must hold an order of all dimensions for each sensor")

    def _arrange(self, generator: torch.Generator | None) -> Mapping[str, Tensor]:
        if not self._reorders:
            return {}
        dim, blocks = self.vsa.dim, self.vsa.blocks
        first = torch.arange(0, dim, blocks)[:, None]
        orders = [first + torch.randperm(blocks, generator=generator) for _ in range(self.sensors - 1)]
        return {"arrangement": torch.stack([torch.arange(dim), *(order.flatten() for order in orders)])}

    def _bound(self, roles: Shaped[Tensor, "n 1 d"], codes: Shaped[Tensor, "#n k d"]) -> Shaped[Tensor, "n k d"]:
        bound = super()._bound(roles, codes)
        if self._reorders:
            return torch.stack([entries[:, order] for entries, order in zip(bound, self.arrangement, strict=True)])
        return self.vsa.permute(bound, torch.arange(self.sensors, device=roles.device)[:, None])

    def _absent(self, like: Shaped[Tensor, "..."]) -> Shaped[Tensor, "d"]:
        return self.vsa.identity().to(like)

    def _join(self, table: Shaped[Tensor, "n entries d"], cells: Int64[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        return bind_entries(self.vsa, table, entry_indices(table, cells))

    def _combine(
        self, bound: Shaped[Tensor, "batch n d"], observed: Bool[Tensor, "batch n"]
    ) -> Shaped[Tensor, "batch d"]:
        known = torch.where(observed[..., None], bound, self._absent(bound))
        return reduce(self.vsa.bind, known.unbind(1))
