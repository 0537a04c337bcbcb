"""The arithmetic of resonator networks: whole numbers in floating point, so that no sum depends on its order."""

import math

import torch
from jaxtyping import Float64, Shaped
from torch import Tensor

from torchvsa._numerics import as_bipolar
from torchvsa.memory._noise import row_noise

_GRID = 2.0**15
"""Elements that are not whole numbers are rounded to this many steps between 0 and the largest of their row."""


class Signs:
    """States of -1 / +1. Sums below 2^24 are exact in float32, others in float64: the results are the same."""

    def __init__(self, rows: Shaped[Tensor, "batch d"], items: int, noise: float) -> None:
        self.items = items
        bound = as_bipolar(rows).to(torch.float64)
        largest = bound.abs().amax(-1, keepdim=True)
        whole = (bound == bound.round()).all(-1, keepdim=True) & (largest <= _GRID)
        bound = torch.where(whole, bound, (bound * (_GRID / torch.where(largest == 0, 1, largest))).round())
        self.chance = torch.linalg.vector_norm(bound, dim=-1)
        """The standard deviation of the similarity with a random item, one per row."""
        reached = items * rows.shape[-1] * (1 + 4 * noise) * float(bound.abs().amax()) if len(bound) else 0.0
        self.bound = bound.to(torch.float32 if reached < 2**24 else torch.float64)

    def codes(self, items: Shaped[Tensor, "k d"]) -> Shaped[Tensor, "k d"]:
        """Items in the type of the states."""
        return as_bipolar(items).to(self.bound.dtype)

    def unbind(self, bound: Shaped[Tensor, "batch d"], state: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
        """What is left without this factor."""
        return bound * state

    def similarities(
        self, unbound: Shaped[Tensor, "batch d"], items: Shaped[Tensor, "k d"]
    ) -> Shaped[Tensor, "batch k"]:
        """The inner product with each item."""
        return unbound @ items.T

    def state(self, total: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
        """The sign of a sum of whole numbers; that of 0 is +1."""
        return total.add_(0.5).sign_()

    def noisy(
        self, similarities: Shaped[Tensor, "batch k"], chance: Float64[Tensor, "batch"], seeds: Tensor, place: int
    ) -> Shaped[Tensor, "batch k"]:
        """Similarities with noise of this standard deviation, rounded to whole numbers."""
        drawn = row_noise(seeds, place * self.items, similarities.shape[-1])
        return similarities + (drawn * chance[:, None]).round().to(similarities.dtype)

    def strength(self, similarities: Shaped[Tensor, "batch k"]) -> Shaped[Tensor, "batch k"]:
        """What a threshold is compared with: of two factors, both with the opposite sign are the same product."""
        return similarities


class Phases(Signs):
    """States of complex numbers of magnitude 1, whose parts are rounded to steps of 2^-15."""

    def __init__(self, rows: Shaped[Tensor, "batch d"], items: int, noise: float) -> None:
        self.items = items
        bound = rows.to(torch.complex128)
        largest = bound.abs().amax(-1, keepdim=True)
        self.bound = _rounded(bound * (_GRID / torch.where(largest == 0, 1, largest)))
        # Similarities keep as many bits as the sums of all items leave in 53.
        self._coarse = 2.0 ** max(0, math.ceil(math.log2(items * rows.shape[-1] * (1 + 4 * noise))) - 20)
        self.chance = torch.linalg.vector_norm(torch.view_as_real(self.bound), dim=(-2, -1)) / self._coarse

    def codes(self, items: Shaped[Tensor, "k d"]) -> Shaped[Tensor, "k d"]:
        return _rounded(items.to(torch.complex128) * _GRID)

    def unbind(self, bound: Shaped[Tensor, "batch d"], state: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
        return _rounded(bound * state.conj() / _GRID)

    def similarities(
        self, unbound: Shaped[Tensor, "batch d"], items: Shaped[Tensor, "k d"]
    ) -> Shaped[Tensor, "batch k"]:
        return _rounded(unbound @ items.conj().T / (_GRID * self._coarse))

    def state(self, total: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
        length = total.abs()
        return torch.where(length == 0, _GRID, _rounded(total * (_GRID / torch.where(length == 0, 1, length))))

    def noisy(
        self, similarities: Shaped[Tensor, "batch k"], chance: Float64[Tensor, "batch"], seeds: Tensor, place: int
    ) -> Shaped[Tensor, "batch k"]:
        drawn = row_noise(seeds, 2 * place * self.items, 2 * similarities.shape[-1]) * (chance[:, None] / 2**0.5)
        return similarities + torch.complex(*drawn.round().chunk(2, -1))

    def strength(self, similarities: Shaped[Tensor, "batch k"]) -> Shaped[Tensor, "batch k"]:
        """Its magnitude: the phases of the factors may all be turned, as long as those of their product add up to 0."""
        return similarities.abs()


def _rounded(x: Shaped[Tensor, "*s"]) -> Shaped[Tensor, "*s"]:
    return torch.view_as_complex(torch.view_as_real(x.resolve_conj()).round())
