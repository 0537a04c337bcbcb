"""Codes that turn into their negative from one end of the range to the other."""

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa.encoders.base import Binned


class Thermometer(Binned):
    """Thermometer codes: similarity falls linearly from 1 to -1, as 1 - 2·|x - y|.

    From bin to bin more elements are negated, in a random order; at the upper end all are. Needs a `negatable`
    architecture.

    Source: Kleyko et al. 2018, "Classification and recall with binary hyperdimensional computing".
    """

    name = "thermometer"
    negates = True

    def _codes(self, generator: torch.Generator | None) -> Shaped[Tensor, "bins d"]:
        start = self.vsa.random(generator=generator)
        order = torch.randperm(self.vsa.dim, generator=generator).to(start.device)
        steps = torch.arange(self.bins, device=start.device)[:, None]
        negated = order * max(self.bins - 1, 1) < self.vsa.dim * steps
        return torch.where(negated, self.vsa.negative(start), start)
