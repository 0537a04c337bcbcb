"""Independent codes per bin."""

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa.encoders.base import Binned


class Lookup(Binned):
    """Independent random hypervectors: similarity 1 within a bin, about 0 between bins.

    Source: Neubert et al. 2016, section II.
    """

    name = "lookup"

    def _codes(self, generator: torch.Generator | None) -> Shaped[Tensor, "bins d"]:
        return self.vsa.random(self.bins, generator=generator)
