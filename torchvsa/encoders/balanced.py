"""Codes that are as far apart as they can be."""

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa.encoders.base import Binned


class Balanced(Binned):
    """Codes as far apart as they can be: in each dimension a random half of them is negated.

    An even number of codes has the cosine -1 / (bins - 1) between any two, an odd one -1 / bins. Two are each other's
    negative; of two random codes half of the elements agree, and cannot tell them apart. Made for the codes of
    commands, between which a program has to decide.

    Source: a simplex of code words, as in error-correcting output codes (Dietterich and Bakiri 1995).
    """

    name = "balanced"

    def _codes(self, generator: torch.Generator | None) -> Shaped[Tensor, "bins d"]:
        start = self.vsa.random(generator=generator)
        ranks = torch.rand(self.bins, self.vsa.dim, generator=generator).argsort(0)
        return torch.where((2 * ranks < self.bins).to(start.device), self.vsa.negative(start), start)
