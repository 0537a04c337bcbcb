"""What architectures share whose hypervectors are real and of length 1."""

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa._numerics import in_range, safe_divide
from torchvsa.architectures.base import VSA


class UnitLength(VSA):
    """Real hypervectors of float32 or float64; a bundle is the sum scaled to length 1."""

    elementwise = False

    def __init__(self, dim: int, dtype: torch.dtype = torch.float32) -> None:
        if dtype not in (torch.float32, torch.float64):
            raise ValueError(f"{self.name} holds float32 or float64; got {dtype}")
        super().__init__(dim, dtype)

    def normalize(self, raw: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Scale to length 1; a zero vector stays zero."""
        rows, lengths, _ = in_range(raw)
        return safe_divide(rows, lengths[..., None].to(rows.dtype))

    def unbundle(
        self, bundled: Shaped[Tensor, "*#batch d"], known: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Estimate `x`: the sum of two nearly orthogonal vectors of length 1 has length √2."""
        return self.normalize(bundled * 2**0.5 - known)


class NormalElements(UnitLength):
    """Hypervectors whose elements are drawn from a normal distribution of variance 1/d."""

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """Normal elements with mean 0 and variance 1/d."""
        self.require_room(shape, 2 * self.dtype.itemsize, generator)
        source = generator.device if generator is not None else device
        normal = torch.randn(*shape, self.dim, generator=generator, device=source, dtype=self.dtype)
        return (normal / self.dim**0.5).to(device if device is not None else source)

    def _are_codes(self, x: Shaped[Tensor, "*batch d"]) -> bool:
        # Ten standard deviations: no drawn element is that far from 0.
        return bool((x.abs() <= 10 / self.dim**0.5).all())
