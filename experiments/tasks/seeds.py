"""Seeds of their own for each combination of numbers."""

import numpy as np
import torch


def seed_of(seed: int, *numbers: int) -> int:
    """A seed that is derived from a study's seed and from the numbers of a cell, e.g. its repeat."""
    return int(np.random.SeedSequence([seed, *numbers]).generate_state(1)[0])


def generator_of(seed: int, *numbers: int) -> torch.Generator:
    """A generator with the seed of `seed_of`."""
    return torch.Generator().manual_seed(seed_of(seed, *numbers))
