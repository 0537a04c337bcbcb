"""A demonstration as a learning rule sees it: distinct conditions, distinct results, and who met whom."""

from dataclasses import dataclass

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from behaviours.demonstrations import Demonstrations
from behaviours.ordered import distinct_rows
from behaviours.space import Space
from torchvsa import VSA


@dataclass(frozen=True)
class Samples:
    """N samples over k distinct conditions and r distinct results, both in order of first appearance."""

    conditions: Shaped[Tensor, "k d"]
    """The protected conditions."""
    results: Int64[Tensor, "r m"]
    """The results, as levels of the actuators."""
    condition: Int64[Tensor, "N"]
    """Which condition each sample has."""
    result: Int64[Tensor, "N"]
    """Which result each sample has."""

    @classmethod
    def of(cls, space: Space, demonstrations: Demonstrations) -> "Samples":
        """Check, quantise and encode a demonstration.

        Conditions are the same if their hypervectors are: rows of equal bins are found first, and only one
        of each is encoded. Raises if a row has no observed sensor.
        """
        bins = space.bins(demonstrations.sensors)
        blind = (bins < 0).all(-1)
        if blind.any():
            raise ValueError(f"row {int(blind.nonzero()[0])} of the demonstration has no observed sensor")
        levels = space.schema.command_levels(demonstrations.commands).to(bins.device)
        distinct_bins, condition = distinct_rows(bins)
        encoded, merged = distinct_rows(space.encode(distinct_bins))
        distinct_results, result = distinct_rows(levels)
        return cls(encoded, distinct_results, merged[condition], result)

    def known(self, vsa: VSA) -> Shaped[Tensor, "d"]:
        """The sum of the distinct conditions, as a raw accumulator."""
        total = torch.zeros(vsa.dim, dtype=vsa.accumulator, device=self.conditions.device)
        for block in self.conditions.split(256):
            total = total + vsa.superpose(block)
        return total
