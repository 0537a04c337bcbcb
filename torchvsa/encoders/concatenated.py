"""Hypervectors of several encoders side by side."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from torchvsa.architectures import VSA, architecture
from torchvsa.encoders.base import Encoder, continuous, planned
from torchvsa.encoders.registry import encoder
from torchvsa.part import Layout

C = TypeVar("C", bound="Concatenated")


class Concatenated(Encoder):
    """Join the hypervectors of several encoders of the same sensors to one with the sum of their dimensions.

    Its kernel is the mean of theirs, weighted by their dimensions:

        boxes = ThresholdFeatures(MAP(3000), sensors=4, subset=2)
        sums = ObliqueFeatures(MAP(1000), sensors=4)
        Concatenated([boxes, sums], seed=0)

    Needs an architecture that binds element by element, so that elements need not come from one draw; the encoders have
    the same one and differ in the dimension. Encoders with a memory are refused: take `History` of this one.
    """

    name = "concatenated"
    discrete = False

    def __init__(self, encoders: Sequence[Encoder], seed: int | None = None) -> None:
        super().__init__()
        if not encoders or not all(isinstance(part, Encoder) for part in encoders):
            raise ValueError(f"encoders is a list of at least one encoder; got {encoders!r:.200}")
        first = encoders[0]
        for part in encoders:
            if {**part.vsa.config(), "dim": 0} != {**first.vsa.config(), "dim": 0}:
                raise ValueError(
                    f"encoders side by side differ in nothing but the dimension; got {part.vsa} and {first.vsa}"
                )
            if part.sensors != first.sensors:
                raise ValueError(f"encoders side by side see the same sensors; got {part.sensors} and {first.sensors}")
            if part.width != part.sensors:
                raise ValueError(f"{part.name} needs past readings; take the history of encoders side by side")
        if not first.vsa.elementwise:
            raise ValueError(f"encoders side by side need element-wise binding, which {first.vsa.name} lacks")
        self.vsa, self.sensors = _with_dim(first.vsa, sum(part.vsa.dim for part in encoders)), first.sensors
        self.encoders = torch.nn.ModuleList(planned(part) for part in encoders)
        self._own(seed)

    def parts(self) -> dict[str, Any]:
        """The encoders, by their prefixes in `state_dict`."""
        return {f"encoders.{name}": part for name, part in self.encoders.named_children()}

    def own_layout(self) -> Layout:
        """No tensors of its own."""
        return {}

    def config(self) -> dict[str, Any]:
        """The name, and of each encoder its dimension and config."""
        return {
            "name": self.name,
            "encoders": [{"dim": part.vsa.dim, **part.config()} for part in self.parts().values()],
        }

    @classmethod
    def from_config(cls: type[C], config: Mapping[str, Any], vsa: VSA) -> C:
        """Make a plan from what `config` returned. Raises `ValueError` if dimensions do not add up to that of `vsa`."""
        parts = [dict(part) for part in config["encoders"]]
        dims = [part.pop("dim") for part in parts]
        if sum(dims) != vsa.dim:
            raise ValueError(f"the dimensions of encoders side by side, {dims}, do not add up to {vsa.dim}")
        return cls([encoder(part, _with_dim(vsa, dim)) for part, dim in zip(parts, dims, strict=True)])

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        return {}

    def cells(self, x: Float[Tensor, "batch n"]) -> Float[Tensor, "batch n"]:
        """The readings, and -1 for NaN."""
        return continuous(x)

    def encode(self, cells: Float[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """The hypervectors of all encoders, one after the other."""
        x = torch.where(cells < 0, torch.nan, cells)
        return torch.cat([part.encode(part.cells(x)) for part in self.parts().values()], -1)


def _with_dim(vsa: VSA, dim: int) -> VSA:
    config: dict[str, Any] = vsa.config()
    return architecture(**{**config, "dim": dim})
