"""Holographic Reduced Representations."""

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from torchvsa.architectures._unit_length import NormalElements


class HRR(NormalElements):
    """Holographic Reduced Representations: bind is circular convolution, bundle the sum scaled to length 1.

    Elements are drawn from a normal distribution of variance 1/d. Unbind is circular correlation, an approximate
    inverse. Both take the Fourier transform.

    Source: Plate 1995, "Holographic reduced representations".
    """

    name = "HRR"

    def identity(self) -> Shaped[Tensor, "d"]:
        """1 at index 0, 0 elsewhere."""
        self.require_room((), self.dtype.itemsize)
        unit = torch.zeros(self.dim, dtype=self.dtype)
        unit[0] = 1
        return unit

    def _bind(self, a: Tensor, b: Tensor) -> Tensor:
        return self._convolve(a, b, conjugate=False)

    def _unbind(self, bound: Tensor, key: Tensor) -> Tensor:
        return self._convolve(bound, key, conjugate=True)

    def _convolve(self, a: Tensor, b: Tensor, conjugate: bool) -> Tensor:
        if a.numel() == 0 or b.numel() == 0:
            # The Fourier transform refuses an empty batch; the product has the right shape.
            return a * b
        spectrum = torch.fft.rfft(b)
        return torch.fft.irfft(torch.fft.rfft(a) * (spectrum.conj() if conjugate else spectrum), n=self.dim)

    def inverse(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The involution, element -i modulo d at index i: the spectrum's angles are negated, its magnitudes kept."""
        self.check(x, "x")
        return x.flip(-1).roll(1, -1)

    def _power(self, x: Tensor, n: float) -> Tensor:
        if x.numel() == 0:
            return x
        spectrum = torch.fft.rfft(x)
        return torch.fft.irfft(torch.polar(spectrum.abs() ** abs(n), spectrum.angle() * n), n=self.dim)

    @property
    def frequencies(self) -> int:
        """The frequencies strictly between 0 and d / 2, whose angles are free in a real vector."""
        return (self.dim - 1) // 2

    def from_angles(self, angles: Float[Tensor, "*batch frequencies"]) -> Shaped[Tensor, "*batch d"]:
        """The inverse Fourier transform of these angles; its length is 1."""
        if 0 in angles.shape[:-1]:
            # The Fourier transform refuses an empty batch.
            return angles.new_zeros(*angles.shape[:-1], self.dim, dtype=self.dtype)
        ends = torch.zeros_like(angles[..., :1]) if angles.shape[-1] else angles.new_zeros(*angles.shape[:-1], 1)
        whole = torch.cat([ends, angles] + ([ends] if self.dim % 2 == 0 else []), -1)
        return torch.fft.irfft(torch.polar(torch.ones_like(whole), whole), n=self.dim).to(self.dtype)
