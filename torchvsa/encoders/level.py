"""Codes whose similarity falls linearly with the distance of their bins."""

from typing import Any

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa.architectures import VSA
from torchvsa.encoders.base import Binned, whole


class Level(Binned):
    """Level codes: similarity is 1 - |i - j| / span for bins i and j, and about 0 from a distance of `span` bins on.

    Every `span` bins there is an independent random hypervector. Between two of them, elements (or blocks, see
    `VSA.blocks`) are replaced one by one, always in the same random order: with another order for each stretch, codes
    `span` bins apart would still share up to a quarter of their elements. By default the span is the whole range, so
    that both ends are independent and the kernel is 1 - |x - y|. `span=1` gives independent codes, as `Lookup` does.

    Source: Rachkovskij et al. 2005; Kleyko et al. 2018 for the linear kernel.
    """

    name = "level"

    def __init__(self, vsa: VSA, bins: int, span: int | None = None, seed: int | None = None) -> None:
        self.span = None if span is None else whole("span", span)
        super().__init__(vsa, bins, seed)

    def config(self) -> dict[str, Any]:
        """The name, the number of bins, and the span."""
        return super().config() | {"span": self.span}

    def _codes(self, generator: torch.Generator | None) -> Shaped[Tensor, "bins d"]:
        span = self.span or max(self.bins - 1, 1)
        segments = -(-(self.bins - 1) // span) if self.bins > 1 else 0
        anchors = self.vsa.random(segments + 1, generator=generator)
        blocks = self.vsa.blocks
        order = torch.randperm(blocks, generator=generator).to(anchors.device).repeat(self.vsa.dim // blocks)
        codes = []
        for bin_ in range(self.bins):
            segment, step = divmod(bin_, span)
            if step == 0:
                codes.append(anchors[segment])
            else:
                # In integers, so that exactly ceil(blocks · step / span) blocks are replaced.
                codes.append(torch.where(order * span < blocks * step, anchors[segment + 1], anchors[segment]))
        return torch.stack(codes)
