"""Binary Spatter Codes."""

import torch
from jaxtyping import Float, Int, Shaped
from torch import Tensor

from torchvsa._checks import refuse_nan
from torchvsa._kernels.look_up import gather_reduce
from torchvsa._numerics import as_bipolar, norms
from torchvsa.architectures._random import random_bits
from torchvsa.architectures._sums import multiplied, stacked
from torchvsa.architectures._ties import first_two
from torchvsa.architectures.base import VSA, Summands


class BSC(VSA):
    """Binary Spatter Codes: bits, bound by XOR and bundled by majority.

    Hypervectors are `torch.bool`. A raw accumulator counts votes (`False` +1, `True` -1) in int32; binding
    one with bits negates its votes where the bit is set, which is what XOR does to each voter. A split vote is
    decided by `permute(bind(x1, x2), 1)`. Similarity is the cosine of the votes: 1 - 2 · (Hamming distance) / d.

    Source: Kanerva 1996, "Binary spatter-coding of ordered k-tuples".
    """

    name = "BSC"
    self_inverse = True
    breaks_ties = True

    def __init__(self, dim: int, dtype: torch.dtype = torch.bool) -> None:
        if dtype != torch.bool:
            raise ValueError(f"BSC holds bits, torch.bool; got {dtype}")
        super().__init__(dim, dtype)

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """See `VSA.random`: fair, independent bits."""
        self.require_room(shape, 3, generator)
        return random_bits(*shape, self.dim, generator=generator, device=device).view(torch.bool)

    def identity(self) -> Shaped[Tensor, "d"]:
        """No bit set."""
        self.require_room((), self.dtype.itemsize)
        return torch.zeros(self.dim, dtype=torch.bool)

    def bind(self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]) -> Shaped[Tensor, "*#batch d"]:
        """XOR; with a raw accumulator, its votes are negated where the other's bit is set."""
        self.check(a, "a")
        self.check(b, "b")
        if a.dtype == torch.bool and b.dtype == torch.bool:
            return a ^ b
        return multiplied(as_bipolar(a), as_bipolar(b))

    def _bind_entries(
        self, table: Shaped[Tensor, "k entries d"], places: Int[Tensor, "batch k"]
    ) -> Shaped[Tensor, "batch d"]:
        """See `VSA._bind_entries`."""
        return gather_reduce(table, places, Tensor.bitwise_xor_)

    def unbind(
        self, bound: Shaped[Tensor, "*#batch d"], key: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """XOR again, an exact inverse."""
        return self.bind(bound, key)

    def normalize(self, raw: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The majority. A raw sum no longer knows its voters, so its own majority, shifted by one, breaks ties."""
        if raw.is_floating_point():
            refuse_nan(raw, "the sum")
        return self._majority(raw, torch.roll(raw < 0, 1, -1))

    def bundle(
        self, xs: Summands, dim: int = -2, weights: Shaped[Tensor, "..."] | None = None
    ) -> Shaped[Tensor, "..."]:
        """See `VSA.bundle`: the majority of the bits."""
        xs, dim = stacked(xs, dim)
        raw = self.superpose(xs, dim, weights)
        if (voters := first_two(xs, dim, weights)) is None:
            return self.normalize(raw)
        tie = self.bind(*voters)
        return self._majority(raw, self.permute(tie if tie.dtype == torch.bool else tie < 0, 1))

    @staticmethod
    def _majority(raw: Tensor, tie: Tensor) -> Tensor:
        return (raw < 0) | ((raw == 0) & tie)

    def unbundle(
        self, bundled: Shaped[Tensor, "*#batch d"], known: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Where the bundle differs from `known`, x does too; elsewhere x is taken to agree."""
        return bundled

    def unbound_norm(self, program: Shaped[Tensor, "d"], keys: Shaped[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """Bits only flip signs: the program's own length, for every key."""
        return norms(program).expand(keys.shape[:-1])
