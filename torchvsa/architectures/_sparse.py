"""What sparse binary architectures share."""

import math
from abc import abstractmethod

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from torchvsa._checks import refuse_nan
from torchvsa._numerics import is_integer
from torchvsa.architectures.base import VSA


class SparseBinary(VSA):
    """Hypervectors of 0 and 1, most of them 0, in int8; a bundle has a 1 where at least one of its members has.

    They are computed with as `[..., d]`, like those of other architectures, which costs the time of dense ones. What is
    kept can be shorter: `positions` lists the ones, about √d numbers of 4 bytes instead of d bytes, and
    `from_positions` is its inverse. Raw accumulators count in int32. Nothing has a `negative`.

    A new sparse architecture implements `ones`, `positions_of_random`, `identity`, `_bind` and `_unbind`.
    """

    commutative = False
    elementwise = False
    exact = True
    negatable = False
    sparse = True

    def __init__(self, dim: int, dtype: torch.dtype = torch.int8) -> None:
        if dtype != torch.int8:
            raise ValueError(f"{self.name} holds 0 and 1 in int8; got {dtype}")
        super().__init__(dim, dtype)

    @property
    @abstractmethod
    def ones(self) -> int:
        """The number of ones in a random hypervector."""

    @abstractmethod
    def positions_of_random(self, count: int, generator: torch.Generator | None) -> Int64[Tensor, "count ones"]:
        """Where `count` random hypervectors have their ones."""

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """Hypervectors with `ones` ones; drawn on a CPU unless there is a generator of another device."""
        self.require_room(shape, 2 + 16 * self.ones // self.dim, generator)
        x = self.from_positions(self.positions_of_random(math.prod(shape), generator)).reshape(*shape, self.dim)
        return x if device is None else x.to(device)

    def from_positions(self, positions: Shaped[Tensor, "*batch ones"]) -> Shaped[Tensor, "*batch d"]:
        """The hypervectors with ones at these positions; -1 stands for none. Raises `ValueError` out of [-1, d)."""
        if positions.numel() and not (int(positions.min()) >= -1 and int(positions.max()) < self.dim):
            raise ValueError(f"positions are whole numbers from 0 to {self.dim - 1}, or -1 for none")
        # The number -1 writes into one element too many, which is cut off.
        padded = torch.zeros(*positions.shape[:-1], self.dim + 1, dtype=self.dtype, device=positions.device)
        wide = positions.to(torch.int64).remainder(self.dim + 1)
        return padded.scatter_(-1, wide, 1)[..., : self.dim].contiguous()

    def positions(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch most"]:
        """The indices of the ones in ascending order, in int32; rows with fewer than the most end in -1."""
        self.check(x, "x")
        marks = x > 0
        most = int(marks.sum(-1).max()) if x.numel() else 0
        indices = torch.arange(self.dim, dtype=torch.int32, device=x.device)
        found = torch.where(marks, indices, self.dim).sort(-1).values[..., :most]
        return torch.where(found == self.dim, -1, found)

    def normalize(self, raw: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """1 where the sum is above 0."""
        if not is_integer(raw):
            refuse_nan(raw, "the sum")
        return (raw > 0).to(self.dtype)

    def unbundle(
        self, bundled: Shaped[Tensor, "*#batch d"], known: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Estimate `x`: the ones of the bundle that `known` has not; those that both have are missing."""
        return self.normalize(bundled.to(self.accumulator) - known)

    def _are_codes(self, x: Shaped[Tensor, "*batch d"]) -> bool:
        return bool(((x == 0) | (x == 1)).all())
