"""Matrix Binding of Additive Terms, with structured matrices."""

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from torchvsa._numerics import norms, safe_sqrt
from torchvsa.architectures._random import random_bits
from torchvsa.architectures._unit_length import UnitLength


class MBAT(UnitLength):
    """Matrix Binding of Additive Terms: the key names an orthogonal matrix that multiplies the hypervector.

    A full matrix takes d² numbers per key (64 MB for d = 4,096 in float32). Here the matrix consists of d/4 blocks of
    4 × 4, and each block follows from four elements of the key: it is the right multiplication by a quaternion. For the
    keys that `random` draws, with elements of ±1/√d, all entries of a block are ±1/2 and its rows are orthogonal (half
    a Hadamard matrix). So no matrix is stored, d is a multiple of 4, and

        bind(a, k) = (√d / 2) · a k        unbind(b, k) = (√d / 2) · b k*

    with the product of quaternions a k, block by block, and the conjugate k*. Unbinding random keys is exact. Binding
    is bilinear and associative, has an identity, and does not commute. Bundle is the sum scaled to length 1.

    Elements i, i + d/4, i + d/2 and i + 3d/4 are a block, so that `permute` by fewer than d/4 mixes no two parts of it.

    Source: Gallant and Okaywe 2013, "Representing objects, relations, and sequences"; the blocks are ours.
    """

    name = "MBAT"
    commutative = False
    exact = True

    def allows_dim(self, dim: int) -> bool:
        """Multiples of 4."""
        return dim % 4 == 0

    @property
    def blocks(self) -> int:
        """One block of 4 elements per quaternion."""
        return self.dim // 4

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """Elements of ±1/√d with equal probability."""
        self.require_room(shape, 2 + 2 * self.dtype.itemsize, generator)
        bits = random_bits(*shape, self.dim, generator=generator, device=device)
        return (1 - 2 * bits.view(torch.int8)).to(self.dtype) / self.dim**0.5

    def identity(self) -> Shaped[Tensor, "d"]:
        """The quaternion 1 in each block, divided by √d / 2."""
        self.require_room((), self.dtype.itemsize)
        unit = torch.zeros(self.dim, dtype=self.dtype)
        unit[: self.dim // 4] = 1 / self._scale
        return unit

    def inverse(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The conjugate of each block: `bind(b, inverse(k)) = unbind(b, k)`."""
        self.check(x, "x")
        return _conjugate(x)

    @property
    def _scale(self) -> float:
        return self.dim**0.5 / 2

    def _bind(self, a: Tensor, b: Tensor) -> Tensor:
        return self._scale * _product(a, b)

    def _unbind(self, bound: Tensor, key: Tensor) -> Tensor:
        return self._scale * _product(bound, _conjugate(key))

    def fold(
        self, program: Shaped[Tensor, "*#batch d"], item: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """`(√d / 2) · r* p`: the real part of `p k* r*` is the product of `k` with `r* p`."""
        return self._scale * _product(_conjugate(item), program)

    def unbound_norm(self, program: Shaped[Tensor, "d"], keys: Shaped[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """The length of the products of blocks, each of which is the product of their lengths."""
        sizes = [safe_sqrt(x.unflatten(-1, (4, -1)).to(torch.float64).square().sum(-2)) for x in (program, keys)]
        return self._scale * norms(sizes[0] * sizes[1])

    def _are_codes(self, x: Shaped[Tensor, "*batch d"]) -> bool:
        return bool(((x.abs() * self.dim**0.5 - 1).abs() < 1e-3).all())


def _product(a: Tensor, b: Tensor) -> Tensor:
    """The products of quaternions, block by block (Hamilton 1843)."""
    a0, a1, a2, a3 = a.chunk(4, -1)
    b0, b1, b2, b3 = b.chunk(4, -1)
    return torch.cat(
        [
            a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
            a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
            a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
            a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
        ],
        -1,
    )


def _conjugate(x: Tensor) -> Tensor:
    quarter = x.shape[-1] // 4
    return torch.cat([x[..., :quarter], -x[..., quarter:]], -1)
