"""Binary Sparse Distributed Codes, bound by shifts."""

import torch
from jaxtyping import Float, Int64, Shaped
from torch import Tensor

from torchvsa._numerics import norms
from torchvsa.architectures._sparse import SparseBinary


class BSDC(SparseBinary):
    """Binary Sparse Distributed Codes with shifts (BSDC-S): √d ones at random places, bound by rotations.

    The key names a width, the sum of the indices of its ones modulo d. Bind rotates the hypervector to the right by
    this width, and unbind rotates it back, which is exact. Bundle is the disjunction.

    A width tells nothing about similar keys: two keys that differ in one element rotate to unrelated places. So bind is
    neither bilinear nor commutative, and a program recalls nothing for a condition that it has not met exactly.

    Source: Rachkovskij 2001, "Representation and processing of structures with binary sparse distributed codes"; shifts
    as in Schlegel et al. 2022, "A comparison of vector symbolic architectures".
    """

    name = "BSDC-S"
    bilinear = False

    @property
    def ones(self) -> int:
        """√d, rounded."""
        return round(self.dim**0.5)

    def positions_of_random(self, count: int, generator: torch.Generator | None) -> Int64[Tensor, "count ones"]:
        """Distinct positions, every set of them equally likely."""
        # Robert Floyd's method: for j = d - ones, ..., d - 1 take a random number up to j or, if it is taken, j itself.
        taken: list[Tensor] = []
        for last in range(self.dim - self.ones, self.dim):
            device = None if generator is None else generator.device
            drawn = torch.randint(last + 1, (count,), generator=generator, device=device)
            repeated = torch.stack(taken).eq(drawn).any(0) if taken else torch.zeros_like(drawn, dtype=torch.bool)
            taken.append(torch.where(repeated, last, drawn))
        return torch.stack(taken, -1)

    def identity(self) -> Shaped[Tensor, "d"]:
        """A single one, at index 0, whose width is 0."""
        self.require_room((), self.dtype.itemsize)
        return self.from_positions(torch.tensor([0]))

    def width(self, key: Shaped[Tensor, "*batch d"]) -> Int64[Tensor, "*batch"]:
        """The sum of the indices of the elements above 0, modulo d: exact, whatever the type and the device."""
        self.check(key, "key")
        # Sums of indices below 2^26 are exact in float64, up to d = 2^26.
        indices = torch.arange(self.dim, dtype=torch.float64, device=key.device)
        return ((key > 0).to(torch.float64) @ indices).to(torch.int64) % self.dim

    def _bind(self, a: Tensor, b: Tensor) -> Tensor:
        return self.permute(a, self.width(b))

    def _unbind(self, bound: Tensor, key: Tensor) -> Tensor:
        return self.permute(bound, -self.width(key))

    def unbound_norm(self, program: Shaped[Tensor, "d"], keys: Shaped[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """The length of the program for every key."""
        return norms(program).expand(keys.shape[:-1])
