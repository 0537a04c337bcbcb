"""How the role-bound values of one record become one hypervector.

A combination is a small class with four jobs: `arrange` draws what it needs beside roles and values; `bound` makes the
table of role-bound values `[n, V, d]` from these three; `unobserved` gives the entry that stands, at index V, for a
value that was not observed; `join` looks up and combines the entries of each record.
"""

from abc import ABC, abstractmethod
from typing import ClassVar

import torch
from jaxtyping import Int, Shaped
from torch import Tensor

from torchvsa.architectures import VSA
from torchvsa.blocks import by_blocks


def _places(table: Shaped[Tensor, "n entries d"], indices: Int[Tensor, "batch n"]) -> Int[Tensor, "batch n"]:
    """Where in the table each index stands: -1 at the end."""
    return torch.where(indices < 0, table.shape[1] - 1, indices)


class Combination(ABC):
    """Turns the n role-bound values of a record into its hypervector."""

    name: ClassVar[str]
    copies: ClassVar[int] = 2
    """Tables that are held at the same time while one is made."""

    def __init__(self, vsa: VSA) -> None:
        self.vsa = vsa

    def arrange(self, sensors: int, generator: torch.Generator | None) -> Shaped[Tensor, "n d"] | None:
        """Draw what tells the sensors apart beside their roles; None for nothing."""
        return None

    @property
    def arranged(self) -> torch.dtype | None:
        """The type of what `arrange` draws; None for nothing."""
        return None

    def bound(
        self, roles: Shaped[Tensor, "n d"], values: Shaped[Tensor, "levels d"], arrangement: Tensor | None
    ) -> Shaped[Tensor, "n levels d"]:
        """The table of role-bound values."""
        return self.vsa.bind(roles[:, None], values)

    def bytes_to_make(self, sensors: int, levels: int) -> int:
        """Memory that making the table takes at its peak."""
        return self.copies * sensors * (levels + 1) * self.vsa.row_bytes

    @abstractmethod
    def unobserved(self, like: Shaped[Tensor, "n levels d"]) -> Shaped[Tensor, "d"]:
        """The entry that stands for a value that was not observed, and leaves the others as they are."""

    @abstractmethod
    def join(self, table: Shaped[Tensor, "n entries d"], indices: Int[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """The record of each row of indices into the table (-1 is unobserved)."""


class Bundled(Combination):
    """The bundle of the role-bound values. Its kernel **averages** the kernels of the values.

    Source: Neubert et al. 2016, Algorithm 1, line 3.
    """

    name = "bundle"

    def unobserved(self, like: Shaped[Tensor, "n levels d"]) -> Shaped[Tensor, "d"]:
        """Zero (its weight is zero as well, so that it has no vote)."""
        return torch.zeros_like(like[0, 0])

    def join(self, table: Shaped[Tensor, "n entries d"], indices: Int[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """Bundle those that were observed."""
        if not self.vsa.breaks_ties:
            return self.vsa.bundle_entries(table, _places(table, indices))
        # The voters themselves decide ties, so they are needed side by side.
        sensors = torch.arange(len(table), device=table.device)
        return by_blocks(
            lambda rows: self.vsa.bundle(table[sensors, rows], weights=rows >= 0),
            indices,
            row_bytes=len(table) * self.vsa.row_bytes,
        )


class Bound(Combination):
    """The product of the role-bound values. Its kernel **multiplies** the kernels of the values.

    Binding commutes, so a product of roles and shared values would not say which sensor had which value;
    the i-th role-bound value is therefore permuted i times. Where binding does not act element by element a
    rotation can be moved out of the product (circular convolution commutes with it), so that the elements of each
    sensor but the first take a random order instead.
    """

    name = "bind"
    copies = 3

    def arrange(self, sensors: int, generator: torch.Generator | None) -> Shaped[Tensor, "n d"] | None:
        """An order of the elements for each sensor, where a rotation would not do; the first keeps its own."""
        if self.vsa.elementwise:
            return None
        orders = [torch.randperm(self.vsa.dim, generator=generator) for _ in range(sensors - 1)]
        return torch.stack([torch.arange(self.vsa.dim), *orders])

    @property
    def arranged(self) -> torch.dtype | None:
        """See `Combination.arranged`."""
        return None if self.vsa.elementwise else torch.int64

    def bound(
        self, roles: Shaped[Tensor, "n d"], values: Shaped[Tensor, "levels d"], arrangement: Tensor | None
    ) -> Shaped[Tensor, "n levels d"]:
        """The role-bound values, those of each sensor permuted in its own way."""
        table = super().bound(roles, values, arrangement)
        if self.vsa.elementwise or arrangement is None:
            return self.vsa.permute(table, torch.arange(len(roles), device=roles.device)[:, None])
        return torch.stack([entries[:, order] for entries, order in zip(table, arrangement, strict=True)])

    def unobserved(self, like: Shaped[Tensor, "n levels d"]) -> Shaped[Tensor, "d"]:
        """The identity of binding."""
        return self.vsa.identity().to(like)

    def join(self, table: Shaped[Tensor, "n entries d"], indices: Int[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """Bind all."""
        return self.vsa.bind_entries(table, _places(table, indices))


class SubsetBound(Bound):
    """The product over a random subset of the sensors, another one for each dimension of the hypervector.

    Each dimension sees an interaction of at most `subset` sensors (of any number of them, by default), so
    that sensors without a say disturb only the dimensions that hold them. Needs an architecture that binds
    element by element.
    """

    name = "subset"

    def __init__(self, vsa: VSA, subset: int | None = None) -> None:
        super().__init__(vsa)
        if not vsa.elementwise:
            raise ValueError(f"a subset of sensors per dimension needs element-wise binding, which {vsa.name} lacks")
        if subset is not None and subset < 1:
            raise ValueError(
                f"subset is the largest number of sensors bound in one dimension, at least 1; got {subset}"
            )
        self.subset = subset

    def bytes_to_make(self, sensors: int, levels: int) -> int:
        """See `Combination.bytes_to_make`; an order of the sensors for each dimension is drawn as well, in int64."""
        return max(super().bytes_to_make(sensors, levels), 2 * 8 * sensors * self.vsa.dim)

    def arrange(self, sensors: int, generator: torch.Generator | None) -> Shaped[Tensor, "n d"] | None:
        """Which sensors each dimension sees: true or false for each of both."""
        most = min(self.subset or sensors, sensors)
        sizes = torch.randint(1, most + 1, (self.vsa.dim,), generator=generator)
        ranks = torch.stack([torch.randperm(sensors, generator=generator) for _ in range(self.vsa.dim)], -1)
        return ranks < sizes

    @property
    def arranged(self) -> torch.dtype | None:
        """See `Combination.arranged`."""
        return torch.bool

    def bound(
        self, roles: Shaped[Tensor, "n d"], values: Shaped[Tensor, "levels d"], arrangement: Tensor | None
    ) -> Shaped[Tensor, "n levels d"]:
        """The role-bound values, those of sensors outside a dimension's subset replaced by the identity."""
        assert arrangement is not None
        table = super().bound(roles, values, None)
        return torch.where(arrangement[:, None], table, self.unobserved(table))


COMBINATIONS: dict[str, type[Combination]] = {c.name: c for c in (Bundled, Bound, SubsetBound)}
