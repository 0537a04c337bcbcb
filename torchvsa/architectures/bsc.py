"""Binary Spatter Codes."""

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from torchvsa._checks import refuse_nan
from torchvsa._numerics import as_bipolar, norms
from torchvsa.architectures._random import random_bits
from torchvsa.architectures._sums import Summands, multiplied, stacked
from torchvsa.architectures._ties import tie_voters
from torchvsa.architectures.base import VSA


class BSC(VSA):
    """Binary Spatter Codes: bits, bound by XOR and bundled by majority.

    Hypervectors are `torch.bool`. XOR is its own exact inverse. A raw accumulator counts votes (`False` +1, `True` -1)
    in int32; binding it with bits negates its votes where a bit is set, which is what XOR does to each summand.
    `permute(bind(x1, x2), 1)` decides ties. Similarity is the cosine of the votes: 1 - 2 · (Hamming distance) / d.

    Source: Kanerva 1996, "Binary spatter-coding of ordered k-tuples".
    """

    name = "BSC"
    self_inverse = True
    exact = True
    breaks_ties = True
    in_place = "bitwise_xor_"

    def __init__(self, dim: int, dtype: torch.dtype = torch.bool) -> None:
        if dtype != torch.bool:
            raise ValueError(f"BSC holds bits, torch.bool; got {dtype}")
        super().__init__(dim, dtype)

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """Independent bits, each set with probability 1/2."""
        self.require_room(shape, 3, generator)
        return random_bits(*shape, self.dim, generator=generator, device=device).view(torch.bool)

    def identity(self) -> Shaped[Tensor, "d"]:
        """No bit is set."""
        self.require_room((), self.dtype.itemsize)
        return torch.zeros(self.dim, dtype=torch.bool)

    def _bind(self, a: Tensor, b: Tensor) -> Tensor:
        if a.dtype == torch.bool and b.dtype == torch.bool:
            return a ^ b
        return multiplied(as_bipolar(a), as_bipolar(b))

    def normalize(self, raw: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The majority. A raw sum does not hold its summands, so its own majority, rotated by one, decides ties."""
        if raw.is_floating_point():
            refuse_nan(raw, "the sum")
        return self._majority(raw, torch.roll(raw < 0, 1, -1))

    def bundle(
        self, xs: Summands, dim: int = -2, weights: Shaped[Tensor, "..."] | None = None
    ) -> Shaped[Tensor, "..."]:
        """The majority of the bits; `permute(bind(x1, x2), 1)` decides ties."""
        xs, dim = stacked(xs, dim)
        raw = self.superpose(xs, dim, weights)
        if (voters := tie_voters(xs, dim, weights)) is None:
            return self.normalize(raw)
        tie = self.bind(*voters)
        return self._majority(raw, self.permute(tie if tie.dtype == torch.bool else tie < 0, 1))

    @staticmethod
    def _majority(raw: Tensor, tie: Tensor) -> Tensor:
        return (raw < 0) | ((raw == 0) & tie)

    def unbundle(
        self, bundled: Shaped[Tensor, "*#batch d"], known: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """The bundle itself: right where it differs from `known`, and elsewhere if `x` agrees with `known`."""
        return bundled

    def unbound_norm(self, program: Shaped[Tensor, "d"], keys: Shaped[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """The length of the program for every key, since bits only flip signs."""
        return norms(program).expand(keys.shape[:-1])
