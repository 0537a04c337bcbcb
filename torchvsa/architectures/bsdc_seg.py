"""Binary Sparse Distributed Codes in segments."""

import math

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from torchvsa._checks import largest, narrowed, readable
from torchvsa._numerics import is_integer
from torchvsa.architectures._sparse import SparseBinary


class BSDCSEG(SparseBinary):
    """Sparse block codes (BSDC-SEG): about √d segments, each of which has a single one.

    A hypervector names one place in each of S segments of L places, d = S · L. Bind adds the places modulo L, segment
    by segment, and unbind subtracts them, which is exact for random keys. In general, bind is the circular convolution
    of each segment and unbind the circular correlation, so that both are bilinear and take raw accumulators. Bind
    commutes. Bundle is the disjunction, so that a segment of a bundle may have several ones.

    The place j of segment s is element j · S + s. A rotation by 1 moves each segment to the next one, so that `permute`
    keeps one place per segment.

    Source: Laiho et al. 2015, "High-dimensional computing with sparse vectors"; Frady et al. 2023, "Variable binding
    for sparse distributed representations", for the convolution.
    """

    name = "BSDC-SEG"
    commutative = True

    def allows_dim(self, dim: int) -> bool:
        """Numbers with a divisor between √d / 2 and √d, the number of segments."""
        return _segments(dim) * 2 >= dim**0.5

    @property
    def blocks(self) -> int:
        """The segments: the largest divisor of d up to √d."""
        return _segments(self.dim)

    @property
    def places(self) -> int:
        """The places of a segment, d / segments."""
        return self.dim // self.blocks

    @property
    def ones(self) -> int:
        """One per segment."""
        return self.blocks

    def positions_of_random(self, count: int, generator: torch.Generator | None) -> Int64[Tensor, "count ones"]:
        """A random place in each segment."""
        device = None if generator is None else generator.device
        places = torch.randint(self.places, (count, self.blocks), generator=generator, device=device)
        return places * self.blocks + torch.arange(self.blocks, device=device)

    def identity(self) -> Shaped[Tensor, "d"]:
        """Place 0 in each segment."""
        self.require_room((), self.dtype.itemsize)
        return self.from_positions(torch.arange(self.blocks))

    def inverse(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Place -j instead of j in each segment: `bind(b, inverse(k)) = unbind(b, k)`."""
        self.check(x, "x")
        segments = x.unflatten(-1, (self.places, self.blocks))
        return segments.roll(-1, -2).flip(-2).flatten(-2)

    def _bind(self, a: Tensor, b: Tensor) -> Tensor:
        keys = self._places(b)
        if keys is None and (keys := self._places(a)) is not None:
            a = b  # bind commutes
        return self._convolved(a, b, conjugate=False) if keys is None else self._rotated(a, keys)

    def _unbind(self, bound: Tensor, key: Tensor) -> Tensor:
        keys = self._places(key)
        return self._convolved(bound, key, conjugate=True) if keys is None else self._rotated(bound, -keys)

    def _places(self, x: Tensor) -> Int64[Tensor, "*batch segments"] | None:
        """The place of each segment, if every segment of all hypervectors has a single one."""
        if x.dtype != self.dtype or not readable(x) or x.numel() == 0 or x.min() < 0:
            return None
        places = torch.arange(self.places, dtype=torch.float32)
        # Sums of whole numbers below 2^24 are exact.
        sums = torch.stack([torch.ones_like(places), places]) @ x.to(torch.float32).unflatten(-1, (-1, self.blocks))
        return sums[..., 1, :].to(torch.int64) if (sums[..., 0, :] == 1).all() else None

    def _rotated(self, x: Tensor, places: Tensor) -> Tensor:
        """Each segment of `x` rotated by its place: the convolution with a single one."""
        if (own := self._places(x)) is not None:
            there = (own + places) % self.places
            return self.from_positions(there * self.blocks + torch.arange(self.blocks))
        at = torch.arange(self.places, device=x.device)[:, None] - places.unsqueeze(-2)
        index = (at.remainder(self.places) * self.blocks + torch.arange(self.blocks, device=x.device)).flatten(-2)
        shape = torch.broadcast_shapes(x.shape, index.shape)
        return x.expand(shape).gather(-1, index.expand(shape))

    def _convolved(self, a: Tensor, b: Tensor, conjugate: bool) -> Tensor:
        """The circular convolution of each segment, exact for integers: rounded from floats."""
        if a.numel() == 0 or b.numel() == 0:
            # The Fourier transform refuses an empty batch; the product has the right shape and type.
            return a * b
        whole = is_integer(a) and is_integer(b)
        if whole and readable(a, b) and self.places * largest(a) * largest(b) > _EXACT:
            raise ValueError("the product of these accumulators of integers is too large to be exact; use floats")
        spectra = [
            torch.fft.rfft(x.to(torch.float64).unflatten(-1, (self.places, self.blocks)), dim=-2) for x in (a, b)
        ]
        product = spectra[0] * (spectra[1].conj() if conjugate else spectra[1])
        result = torch.fft.irfft(product, n=self.places, dim=-2).flatten(-2)
        dtype = torch.promote_types(a.dtype, b.dtype)
        return narrowed(result.round().to(torch.int64), dtype, "the product") if whole else result.to(dtype)


_EXACT = 2**46
"""Up to this sum of absolute products, the transforms in float64 are exact to less than a half."""


def _segments(dim: int) -> int:
    return next(count for count in range(math.isqrt(dim), 0, -1) if dim % count == 0)
