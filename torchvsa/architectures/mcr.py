"""Modular Composite Representation."""

import math

import torch
from jaxtyping import Bool, Float, Int64, Shaped
from torch import Tensor

from torchvsa.architectures.base import VSA
from torchvsa.architectures.fhrr import FHRR


class MCR(FHRR):
    """Modular Composite Representation: elements are whole numbers modulo 16, bind adds them and unbind subtracts.

    The number j is held as the complex number e^(2πij/16), so that bind is the element-wise product, a raw accumulator
    is a sum of complex numbers, and the same similarity as in `FHRR` compares them. Bundle rounds the angle of the sum
    to the nearest of the 16; an element that sums to 0 stays 0.

    `numbers` and `from_numbers` convert to whole numbers, a byte each instead of 8, and back.

    Source: Snaider and Franklin 2014, "Modular composite representation".
    """

    name = "MCR"
    modulus = 16
    """The number of values of an element."""

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """Elements that are equally likely to be each of the 16 values."""
        self.require_room(shape, 10 + 2 * self.dtype.itemsize, generator)
        source = generator.device if generator is not None else device
        numbers = torch.randint(self.modulus, (*shape, self.dim), generator=generator, device=source, dtype=torch.uint8)
        return self.from_numbers(numbers).to(device if device is not None else source)

    def from_numbers(self, numbers: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The hypervectors with these whole numbers; they count modulo 16."""
        return self._roots(numbers.device)[numbers.to(torch.int64) % self.modulus]

    def numbers(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The nearest whole number from 0 to 15 for each element, in uint8; 0 for an element that is 0.

        An angle halfway between two numbers goes to the lower one.
        """
        self.check(x, "x")
        turns = torch.where(x == 0, 0.0, x.angle()) * (self.modulus / (2 * math.pi))
        # The sum of two neighbours is halfway between them, up to rounding.
        return ((turns + (0.5 - HALFWAY)).floor().to(torch.int64) % self.modulus).to(torch.uint8)

    def hamming_similarity(
        self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]
    ) -> Int64[Tensor, "*#batch"]:
        """How many `numbers` of `a` and `b` are equal: products of complex numbers are rounded."""
        return super().hamming_similarity(self.numbers(a), self.numbers(b))

    def normalize(self, raw: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Round the angle of every element to the nearest sixteenth of a turn; zero stays zero."""
        self.check(raw, "raw")
        nearest = self._roots(raw.device)[self.numbers(raw).to(torch.int64)]
        sizes = raw.abs()
        # What is left of numbers that cancel is rounding.
        return torch.where(sizes <= CANCELLED * sizes.amax(-1, keepdim=True), 0.0, nearest).to(self.dtype)

    @property
    def frequencies(self) -> None:
        """None: fractional powers have angles between the 16."""
        return None

    def from_angles(self, angles: Float[Tensor, "*batch frequencies"]) -> Shaped[Tensor, "*batch d"]:
        """Raises `ValueError`, since most angles are not among the 16."""
        return VSA.from_angles(self, angles)

    def positive(self, x: Shaped[Tensor, "*batch d"]) -> Bool[Tensor, "*batch d"]:
        """Which elements are less than a quarter of a turn from 0: 13, 14, 15, 0, 1, 2 and 3."""
        quarter = self.modulus // 4
        return ((self.numbers(x).to(torch.int64) + quarter - 1) % self.modulus < 2 * quarter - 1) & (x != 0)

    def unbundle(
        self, bundled: Shaped[Tensor, "*#batch d"], known: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Estimate `x` as in `FHRR`, rounded."""
        return self.normalize(super().unbundle(bundled, known))

    def _roots(self, device: torch.device) -> Shaped[Tensor, "modulus"]:
        angles = torch.arange(self.modulus // 4, dtype=torch.float64, device=device) * (2 * math.pi / self.modulus)
        quarter = torch.polar(torch.ones_like(angles), angles).to(self.dtype)
        half = torch.cat([quarter, torch.complex(-quarter.imag, quarter.real)])
        # Opposite numbers have exactly opposite elements, so that their sum is 0.
        return torch.cat([half, -half])

    def _are_codes(self, x: Shaped[Tensor, "*batch d"]) -> bool:
        return bool(((x - self._roots(x.device)[self.numbers(x).to(torch.int64)]).abs() < 1e-3).all())


HALFWAY = 1e-4
"""How near to the middle between two numbers an angle counts as halfway, in steps; sums in float32 round to 1e-6."""
CANCELLED = 1e-5
"""The share of a vector's largest element below which an element is what rounding left of numbers that cancel."""
