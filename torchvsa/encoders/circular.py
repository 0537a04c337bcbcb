"""Codes for angles: both ends of the range are the same."""

import torch
from jaxtyping import Float, Int64, Shaped
from torch import Tensor

from torchvsa.encoders.base import Binned


class Circular(Binned):
    """Codes for angles, where 0 and 1 are the same: similarity falls linearly with the distance on the circle.

    The kernel is 1 - 2·δ, with δ the distance on the circle in turns: 0 for opposite readings. Over the first half of
    the circle, half of the elements are negated one by one; over the second half they are negated back in the same
    order. Needs a `negatable` architecture.

    Source: Kleyko et al. 2023, "A survey on hyperdimensional computing", part I, on circular scalars.
    """

    name = "circular"
    negates = True

    def cells(self, x: Float[Tensor, "*batch"]) -> Int64[Tensor, "*batch"]:
        """The bin of each reading; 1 is in the first bin, like 0."""
        return torch.where(x >= 1, 0, super().cells(x))

    def _codes(self, generator: torch.Generator | None) -> Shaped[Tensor, "bins d"]:
        start = self.vsa.random(generator=generator)
        order = torch.randperm(self.vsa.dim, generator=generator).to(start.device)
        # In units of 1 / bins of an element, so that integers are compared.
        at = torch.arange(self.bins, device=start.device)[:, None] * self.vsa.dim
        positions, half = order * self.bins, self.bins * self.vsa.dim // 2
        negated = (positions < at) & (positions < half) & ~(positions < at - half)
        return torch.where(negated, self.vsa.negative(start), start)
