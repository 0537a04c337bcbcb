"""Codes with the largest possible distances."""

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa.encoders.base import Binned


class Balanced(Binned):
    """Codes with the largest possible distances: in each dimension a random half of them is negated.

    The cosine between any two codes is -1 / (bins - 1) for an even number of codes, -1 / bins for an odd one. Two codes
    are each other's negative, while half of the elements of two random codes agree and cannot tell them apart. Meant
    for the codes of commands, between which a program decides.

    Source: a simplex of code words, as in error-correcting output codes (Dietterich and Bakiri 1995).
    """

    name = "balanced"
    negates = True

    def _codes(self, generator: torch.Generator | None) -> Shaped[Tensor, "bins d"]:
        start = self.vsa.random(generator=generator)
        ranks = torch.rand(self.bins, self.vsa.dim, generator=generator).argsort(0)
        return torch.where((2 * ranks < self.bins).to(start.device), self.vsa.negative(start), start)
