"""Continuous codes: fractional powers of a base hypervector under binding."""

import math
from typing import Any, Literal

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA
from torchvsa.encoders.base import ValueEncoder, continuous
from torchvsa.part import Layout


class FractionalPower(ValueEncoder):
    """Fractional power encoding: element j of the spectrum of x is e^(i·θⱼ·x / length), without any bins.

    | `kernel` | θ | cosine of the codes of x and y, with Δ = (x - y) / length |
    |---|---|---|
    | `"sinc"` | uniform in [-π, π] | sin(πΔ) / (πΔ) |
    | `"gaussian"` | normal, of variance 1 | e^(-Δ² / 2) |

    FHRR holds the spectrum itself, HRR its inverse Fourier transform. Raises `ValueError` for other architectures.

    Source: Plate 1992; Komer et al. 2019; Frady et al. 2021, "Computing on functions using randomized vector
    representations", for the kernels.
    """

    name = "fractional_power"
    discrete = False
    theta: Tensor

    def __init__(
        self,
        vsa: VSA,
        length: float = 0.2,
        kernel: Literal["sinc", "gaussian"] = "gaussian",
        seed: int | None = None,
    ) -> None:
        super().__init__()
        if vsa.frequencies is None:
            raise ValueError(f"fractional powers need an architecture with a spectrum (FHRR, HRR); {vsa.name} has none")
        if kernel not in ("sinc", "gaussian"):
            raise ValueError(f"kernel is 'sinc' or 'gaussian'; got {kernel!r}")
        if not (isinstance(length, int | float) and 0 < length < math.inf):
            raise ValueError(f"length is the unit of distance of the kernel, above 0; got {length!r}")
        self.vsa, self.length, self.kernel = vsa, float(length), kernel
        self._own(seed)

    def own_layout(self) -> Layout:
        """`theta`, one angle per frequency."""
        assert self.vsa.frequencies is not None
        return {"theta": (torch.float64, (self.vsa.frequencies,))}

    def config(self) -> dict[str, Any]:
        """The name, the length and the kernel."""
        return {"name": self.name, "length": self.length, "kernel": self.kernel}

    def check(self) -> None:
        """Raise `ValueError` unless all angles are finite."""
        if not self.theta.isfinite().all():
            raise ValueError("theta must hold finite angles")

    def cells(self, x: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """The readings, and -1 for NaN."""
        return continuous(x)

    def encode(self, cells: Float[Tensor, "*batch"]) -> Shaped[Tensor, "*batch d"]:
        """The base hypervector to the power of each reading."""
        return self.vsa.from_angles(cells[..., None].to(self.theta.dtype) / self.length * self.theta)

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        ((_, shape),) = self.own_layout().values()
        require_memory(24 * shape[0], f"drawing {shape[0]:,} angles", "take fewer dimensions")
        if self.kernel == "sinc":
            return {"theta": (2 * torch.rand(shape, generator=generator, dtype=torch.float64) - 1) * math.pi}
        return {"theta": torch.randn(shape, generator=generator, dtype=torch.float64)}
