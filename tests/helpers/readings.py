"""Readings for tests of encoders."""

import torch
from torch import Tensor


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def centres(cells: Tensor, bins: int) -> Tensor:
    """The middle of each bin, NaN for -1."""
    return torch.where(cells < 0, torch.nan, (cells.double() + 0.5) / bins)


def rows(count: int, sensors: int, missing: float = 0.2, seed: int = 1) -> Tensor:
    """Readings in [0, 1], some of them NaN; the first sensor is always observed."""
    generator = seeded(seed)
    x = torch.rand(count, sensors, generator=generator, dtype=torch.float64)
    hidden = torch.rand(count, sensors, generator=generator) < missing
    hidden[:, 0] = False
    return torch.where(hidden, torch.nan, x)
