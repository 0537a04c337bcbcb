"""Damage to a share of the elements of something that has learned."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DAMAGES = {"flip": "sign flipped", "zero": "set to zero", "noise": "Gaussian noise added"}
PARTS = {"program": "the program", "codebooks": "the codebooks", "query": "the query"}
"""The parts of a learner that has hypervectors."""
PARAMETERS = "parameters"
"""The one part of a learner that has none."""


@dataclass(frozen=True)
class Array:
    """Elements `[n, ...]` that can be damaged one by one; a flipped `x` becomes `mirror - x`."""

    values: Floats
    mirror: float = 0.0


@dataclass(frozen=True)
class Damage:
    """What happens to a share of the elements, and to which of them.

    The elements are drawn from `seed` alone, so a larger share hits those of a smaller one and more, and all kinds hit
    the same ones. `noise` is the standard deviation in root mean squares of the array that an element is in.
    """

    kind: str
    share: float
    noise: float
    seed: tuple[int, ...]

    def count(self, size: int) -> int:
        """How many of `size` elements are damaged: the share, rounded half up."""
        return int(np.floor(self.share * size + 0.5))

    def __call__(self, arrays: Sequence[Array], key: Sequence[int] = ()) -> list[Floats]:
        """Damaged copies of arrays, whose elements are drawn from all of them together; `key` joins the seed."""
        sizes = [len(array.values) for array in arrays]
        rng = np.random.default_rng([*self.seed, *key])
        hit = np.sort(rng.permutation(sum(sizes))[: self.count(sum(sizes))])
        copies = []
        for array, end in zip(arrays, np.cumsum(sizes), strict=True):
            rows = hit[(hit >= end - len(array.values)) & (hit < end)] - (end - len(array.values))
            values = array.values.copy()
            if self.kind == "flip":
                values[rows] = array.mirror - values[rows]
            elif self.kind == "zero":
                values[rows] = 0.0
            else:
                spread = self.noise * np.sqrt(np.mean(array.values**2))
                values[rows] += spread * rng.standard_normal(values[rows].shape)
            copies.append(values)
        return copies


class Learner(Protocol):
    """Something that has learned, of which a part can be damaged."""

    def elements(self, part: str) -> int:
        """How many elements the part has."""
        ...

    def damaged(self, part: str, damage: Damage) -> Callable[[Floats], Floats]:
        """A copy of which `part` is damaged: commands `[B, 2]` for readings `[B, 3]`."""
        ...
