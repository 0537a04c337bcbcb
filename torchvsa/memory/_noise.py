"""Noise that belongs to a row: the same numbers whatever other rows are in the batch."""

import torch
from jaxtyping import Float64, Int64
from torch import Tensor

_GOLDEN = -7046029254386353131  # 0x9E3779B97F4A7C15
_FIRST = -4658895280553007687  # 0xBF58476D1CE4E5B9
_SECOND = -7723592293110705685  # 0x94D049BB133111EB
_SPREAD = (4 * (2.0**32 - 1) / 12) ** 0.5
"""The standard deviation of the sum of four uniform numbers of 16 bits."""


def row_seeds(rows: int, generator: torch.Generator) -> Int64[Tensor, "rows"]:
    """A seed for each row, drawn in the order of the rows: the parts of a batch, one after the other, get the same."""
    return torch.randint(2**63 - 1, (rows,), generator=generator, device=generator.device)


def row_noise(seeds: Int64[Tensor, "rows"], first: int, count: int) -> Float64[Tensor, "rows count"]:
    """Nearly normal numbers of mean 0 and variance 1: those at the places `first`, `first` + 1, ... of each row.

    Each is the sum of the four 16-bit parts of one output of SplitMix64, within ±3.5. All operations are exact or
    element by element, so that a row has the same bits in every batch.

    Source: Steele, Lea and Flood 2014, "Fast splittable pseudorandom number generators".
    """
    counters = torch.arange(first + 1, first + count + 1, device=seeds.device)
    bits = seeds[:, None] + counters * _GOLDEN
    bits = (bits ^ _shifted(bits, 30)) * _FIRST
    bits = (bits ^ _shifted(bits, 27)) * _SECOND
    bits = bits ^ _shifted(bits, 31)
    total = (bits & 0xFFFF) + (_shifted(bits, 16) & 0xFFFF) + (_shifted(bits, 32) & 0xFFFF) + _shifted(bits, 48)
    return (total - 2 * 0xFFFF).to(torch.float64) / _SPREAD


def _shifted(bits: Int64[Tensor, "rows count"], places: int) -> Int64[Tensor, "rows count"]:
    """A shift to the right that fills with zeros."""
    return (bits >> places) & ((1 << (64 - places)) - 1)
