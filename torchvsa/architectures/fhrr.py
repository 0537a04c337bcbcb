"""Fourier Holographic Reduced Representations."""

import math

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from torchvsa._numerics import safe_divide, safe_sqrt, units
from torchvsa.architectures.base import VSA


class FHRR(VSA):
    """Fourier HRR: elements are complex numbers of magnitude 1, and bind adds their angles.

    Bind is the element-wise product, unbind the product with the conjugate: exact for keys whose elements have
    magnitude 1. Bundle keeps the angle of the sum; an element that sums to 0 stays 0.

    Source: Plate 1994; Gayler 2003.
    """

    name = "FHRR"
    exact = True

    def __init__(self, dim: int, dtype: torch.dtype = torch.complex64) -> None:
        if dtype not in (torch.complex64, torch.complex128):
            raise ValueError(f"{self.name} holds complex64 or complex128; got {dtype}")
        super().__init__(dim, dtype)

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """Elements whose angles are uniform in [-π, π)."""
        self.require_room(shape, 2 * self.dtype.itemsize, generator)
        source = generator.device if generator is not None else device
        real = torch.float64 if self.dtype == torch.complex128 else torch.float32
        angles = torch.rand(*shape, self.dim, generator=generator, device=source, dtype=real) * (2 * math.pi) - math.pi
        return torch.polar(torch.ones_like(angles), angles).to(device if device is not None else source)

    def identity(self) -> Shaped[Tensor, "d"]:
        """All ones: every angle is 0."""
        self.require_room((), self.dtype.itemsize)
        return torch.ones(self.dim, dtype=self.dtype)

    def _bind(self, a: Tensor, b: Tensor) -> Tensor:
        return a * b

    def _unbind(self, bound: Tensor, key: Tensor) -> Tensor:
        return bound * key.conj()

    def inverse(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The complex conjugate: every angle is negated."""
        self.check(x, "x")
        return torch.conj_physical(x)

    def _power(self, x: Tensor, n: float) -> Tensor:
        return torch.polar(x.abs() ** abs(n), x.angle() * n)

    def normalize(self, raw: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Scale every element to magnitude 1; zero stays zero."""
        return safe_divide(raw, raw.abs())

    @property
    def frequencies(self) -> int | None:
        """One angle per element."""
        return self.dim

    def from_angles(self, angles: Float[Tensor, "*batch frequencies"]) -> Shaped[Tensor, "*batch d"]:
        """The elements e^(i·angle)."""
        return torch.polar(torch.ones_like(angles), angles).to(self.dtype)

    def _are_codes(self, x: Shaped[Tensor, "*batch d"]) -> bool:
        return bool(((x.abs() - 1).abs() < 1e-3).all())

    def unbundle(
        self, bundled: Shaped[Tensor, "*#batch d"], known: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Estimate `x` as `known` mirrored at the bundle: the angle of a sum of two is midway between theirs."""
        return bundled**2 * known.conj()

    def unbound_norm(self, program: Shaped[Tensor, "d"], keys: Shaped[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """The square root of `|key|² · |program|²`: one matrix product for the batch."""
        unit = units(program)
        return safe_sqrt(keys.abs() ** 2 @ ((program.abs() / unit) ** 2)) * unit.to(torch.float64)
