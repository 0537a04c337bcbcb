"""Records that bind a random subset of the sensors in each dimension."""

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa.encoders.base import ValueEncoder, whole
from torchvsa.encoders.product import Product
from torchvsa.part import Layout


class SubsetProduct(Product):
    """The product over a random subset of the sensors, drawn for each dimension of the hypervector.

    A dimension depends on 1 to `subset` sensors (by default on any number), so that irrelevant sensors disturb only the
    dimensions that contain them. Needs an architecture with element-wise binding.
    """

    name = "subset_product"
    chosen: Tensor

    def __init__(
        self,
        values: ValueEncoder | Sequence[ValueEncoder],
        sensors: int | None = None,
        subset: int | None = None,
        seed: int | None = None,
    ) -> None:
        self.subset = None if subset is None else whole("subset", subset)
        super().__init__(values, sensors, seed)

    def own_layout(self) -> Layout:
        """`roles` `[n, d]`, and `chosen` `[n, d]`: whether the dimension depends on the sensor."""
        if not self.vsa.elementwise:
            raise ValueError(f"a subset of sensors per dimension needs element-wise binding, which {self.vsa} lacks")
        return super().own_layout() | {"chosen": (torch.bool, (self.sensors, self.vsa.dim))}

    def config(self) -> dict[str, Any]:
        """The config of a record, and the size of the subsets."""
        return super().config() | {"subset": self.subset}

    def check(self) -> None:
        """Raise `ValueError` unless roles are hypervectors."""
        self.vsa.check_codes(self.roles, "roles")

    def _arrange(self, generator: torch.Generator | None) -> Mapping[str, Tensor]:
        most = min(self.subset or self.sensors, self.sensors)
        sizes = torch.randint(1, most + 1, (self.vsa.dim,), generator=generator)
        ranks = torch.stack([torch.randperm(self.sensors, generator=generator) for _ in range(self.vsa.dim)], -1)
        return {"chosen": ranks < sizes}

    def _bound(self, roles: Shaped[Tensor, "n 1 d"], codes: Shaped[Tensor, "#n k d"]) -> Shaped[Tensor, "n k d"]:
        bound = super()._bound(roles, codes)
        return torch.where(self.chosen[:, None], bound, self._absent(bound))
