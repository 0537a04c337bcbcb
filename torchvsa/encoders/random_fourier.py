"""Random Fourier features: a Gaussian kernel over all sensors at once."""

import math
from typing import Any

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA
from torchvsa.encoders.base import Encoder, continuous, whole
from torchvsa.part import Layout


class RandomFourier(Encoder):
    """Random Fourier features √2·cos(ω·x / length + b), whose kernel is e^(-|x - y|² / (2·length²)).

    With `sign` each element is the sign of its cosine, which suits integers; the kernel is then
    (8 / π²)·Σ K(j·Δ) / j² over odd j, with K the Gaussian. A reading that was not observed is left out of ω·x. Needs
    an architecture with real elements and element-wise binding; without `sign`, with float elements.

    Source: Rahimi and Recht 2007, "Random features for large-scale kernel machines"; Raginsky and Lazebnik 2009 for
    the signs.
    """

    name = "random_fourier"
    discrete = False
    omega: Tensor
    phase: Tensor

    def __init__(self, vsa: VSA, sensors: int, length: float = 0.2, sign: bool = True, seed: int | None = None) -> None:
        super().__init__()
        if vsa.dtype.is_complex or vsa.dtype == torch.bool or not vsa.elementwise:
            raise ValueError(
                f"random Fourier features need real elements and element-wise binding; {vsa.name} lacks them"
            )
        if not sign and not vsa.dtype.is_floating_point:
            raise ValueError(f"{vsa} holds no fractions; take sign=True, or a float dtype")
        if not (isinstance(length, int | float) and 0 < length < math.inf):
            raise ValueError(f"length is the width of the kernel, above 0; got {length!r}")
        self.vsa, self.sensors, self.length, self.sign = vsa, whole("sensors", sensors), float(length), bool(sign)
        self._own(seed)

    def own_layout(self) -> Layout:
        """`omega` `[n, d]` and `phase` `[d]`."""
        dim = self.vsa.dim
        return {"omega": (torch.float64, (self.sensors, dim)), "phase": (torch.float64, (dim,))}

    def config(self) -> dict[str, Any]:
        """The name and the options."""
        return {"name": self.name, "sensors": self.sensors, "length": self.length, "sign": self.sign}

    def check(self) -> None:
        """Raise `ValueError` unless all numbers are finite."""
        for name in ("omega", "phase"):
            if not getattr(self, name).isfinite().all():
                raise ValueError(f"{name} must hold finite numbers")

    def cells(self, x: Float[Tensor, "batch n"]) -> Float[Tensor, "batch n"]:
        """The readings, and -1 for NaN."""
        return continuous(x)

    def encode(self, cells: Float[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """The cosine of each projection, or its sign."""
        observed = torch.where(cells < 0, 0.0, cells).to(self.omega.dtype)
        # Sensor by sensor: the same bits at any batch size, unlike a matrix product.
        angles = self.phase.expand(len(cells), -1)
        for column, omega in zip(observed.unbind(1), self.omega, strict=True):
            angles = torch.addcmul(angles, column[:, None], omega, value=1 / self.length)
        waves = angles.cos()
        if self.sign:
            return torch.where(waves >= 0, 1, -1).to(self.vsa.dtype)
        return (2**0.5 * waves).to(self.vsa.dtype)

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        require_memory(
            16 * (self.sensors + 1) * self.vsa.dim,
            f"drawing random features of {self.sensors:,} sensors at d = {self.vsa.dim:,}",
            "take fewer sensors or dimensions",
        )
        omega = torch.randn(self.sensors, self.vsa.dim, generator=generator, dtype=torch.float64)
        phase = torch.rand(self.vsa.dim, generator=generator, dtype=torch.float64) * (2 * math.pi)
        return {"omega": omega, "phase": phase}
