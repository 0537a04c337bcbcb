"""Multiply-Add-Permute."""

from typing import Literal

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from torchvsa._checks import narrowed, refuse_nan
from torchvsa._numerics import inner_products, is_integer, safe_sqrt, units, widened
from torchvsa.architectures._random import random_bits
from torchvsa.architectures._sums import Summands, multiplied, stacked
from torchvsa.architectures._ties import tie_voters
from torchvsa.architectures.base import VSA


class MAP(VSA):
    """Multiply-Add-Permute: bind and unbind are the element-wise product, bundle is the sum, permute a rotation.

    | variant | elements of `random` | bundle |
    |---|---|---|
    | C | -1 / +1, or uniform in [-1, 1] with `atoms="uniform"` | the sum, clipped to [-1, 1] |
    | B | -1 / +1 | the sign of the sum; `permute(bind(x1, x2), 1)` decides ties |
    | I | -1 / +1 | the sum |

    Unbind is exact for keys of -1 / +1. `dtype=torch.float32` is differentiable. `torch.int8` is exact and smallest;
    sums accumulate in int32. Elements in int8 must be -1, 0 or +1, which no method checks: others may wrap around in
    `bind`, records and protections. `superpose`, `bundle` and `similarity` are right for any int8 numbers, and every
    method is for accumulators in int32.

    Source: Gayler 1998; Neubert et al. 2016, section II (variant C).
    """

    in_place = "mul_"

    def __init__(
        self,
        dim: int,
        variant: Literal["C", "B", "I"] = "C",
        dtype: torch.dtype = torch.float32,
        atoms: Literal["bipolar", "uniform"] = "bipolar",
    ) -> None:
        if variant not in ("C", "B", "I"):
            raise ValueError(f"MAP has the variants 'C', 'B' and 'I'; got {variant!r}")
        if dtype not in (torch.float32, torch.float64, torch.int8):
            raise ValueError(f"MAP holds float32, float64 or int8 codes; got {dtype}")
        if atoms not in ("bipolar", "uniform") or (atoms == "uniform" and (variant != "C" or dtype == torch.int8)):
            raise ValueError(
                f"atoms are 'bipolar', or 'uniform' with variant 'C' and a float dtype; "
                f"got {atoms!r} with {variant!r}, {dtype}"
            )
        super().__init__(dim, dtype)
        self.variant = variant
        self.atoms = atoms
        self.name = f"MAP-{variant}"
        self.breaks_ties = variant == "B"
        self.clips = variant == "C"
        self.self_inverse = self.exact = atoms == "bipolar"

    def config(self) -> dict[str, str | int]:
        """Name, dim and dtype, and the atoms if they are not the default."""
        return super().config() | ({} if self.atoms == "bipolar" else {"atoms": self.atoms})

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """Elements of -1 / +1 with equal probability, or uniform in [-1, 1]."""
        # Bits, int8 elements and those in another type; or uniform numbers, scaled and shifted.
        size = self.dtype.itemsize
        self.require_room(shape, 3 * size if size == 1 or self.atoms == "uniform" else 2 + size, generator)
        if self.atoms == "uniform":
            source = generator.device if generator is not None else device
            uniform = torch.rand(*shape, self.dim, generator=generator, device=source, dtype=self.dtype)
            return (2 * uniform - 1).to(device if device is not None else source)
        bits = random_bits(*shape, self.dim, generator=generator, device=device)
        return (1 - 2 * bits.view(torch.int8)).to(self.dtype)

    def identity(self) -> Shaped[Tensor, "d"]:
        """All ones."""
        self.require_room((), self.dtype.itemsize)
        return torch.ones(self.dim, dtype=self.dtype)

    def _bind(self, a: Tensor, b: Tensor) -> Tensor:
        return multiplied(a, b)

    def inverse(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The hypervector itself, with uniform atoms too: unbind is bind."""
        self.check(x, "x")
        return x

    def normalize(self, raw: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """C: clip to [-1, 1], keeping 0; for int8, round to the nearest element. I: the sum itself. B: the sign.

        A raw sum does not hold its summands, so in variant B its own signs, rotated by one, decide its zeros.
        """
        if raw.is_floating_point() and (self.integer or self.variant == "B"):
            refuse_nan(raw, "the sum")
        if self.variant == "C":
            clipped = raw.clamp(-1, 1)
            # A cast alone would cut a sum of fractions such as 0.9999999 down to 0.
            nearest = clipped.round() if self.dtype == torch.int8 and raw.is_floating_point() else clipped
            return nearest.to(self.dtype)
        if self.variant == "I":
            return self._accumulated(raw) if is_integer(raw) else raw
        return self._signs(raw, torch.roll(torch.where(raw >= 0, 1, -1), 1, -1))

    def bundle(
        self, xs: Summands, dim: int = -2, weights: Shaped[Tensor, "..."] | None = None
    ) -> Shaped[Tensor, "..."]:
        """The sum, normalised as the variant says."""
        xs, dim = stacked(xs, dim)
        raw = self.superpose(xs, dim, weights)
        if self.variant == "B" and (voters := tie_voters(xs, dim, weights)) is not None:
            return self._signs(raw, self.permute(self.bind(*voters), 1))
        return self.normalize(raw)

    def _bundle_pair(
        self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        whole = is_integer(a) or is_integer(b)
        if self.variant != "C" or (whole and not a.dtype == b.dtype == torch.int8):
            return super()._bundle_pair(a, b)
        # Two elements of [-1, 1] add up within the codes' own type.
        return self.normalize(a + b)

    def _signs(self, raw: Tensor, tie: Tensor) -> Tensor:
        if tie.dtype != self.dtype:
            tie = tie.sign()  # a product of accumulators may not fit the codes' type
        return torch.where(raw == 0, tie, raw.sign()).to(self.dtype)

    def _are_codes(self, x: Shaped[Tensor, "*batch d"]) -> bool:
        return bool((x.abs() <= 1).all() if self.atoms == "uniform" else ((x == 1) | (x == -1)).all())

    def _accumulated(self, raw: Tensor) -> Tensor:
        return (
            narrowed(raw, torch.int32, "the sum")
            if raw.dtype == torch.int64 and self.integer
            else raw.to(self.accumulator)
        )

    def unbundle(
        self, bundled: Shaped[Tensor, "*#batch d"], known: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Estimate `x` from `bundle([x, known])`.

        C: exact for `x` of -1 / +1 (where the sum is 0, `x = -known`). I: exact. B: the bundle itself, right for 3 of 4
        elements: where it differs from `known`, and elsewhere if `x` agrees with `known`.
        """
        if self.variant == "C":
            return torch.where(bundled == 0, -known, bundled)
        if self.variant == "I":
            return bundled - known
        return bundled

    def unbound_norm(self, program: Shaped[Tensor, "d"], keys: Shaped[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """The square root of `key² · program²`: one matrix product for the batch."""
        if is_integer(program):
            return safe_sqrt(inner_products(keys.to(torch.float64) ** 2, program.to(torch.float64)[None] ** 2)[..., 0])
        program = widened(program)
        unit = units(program)
        squares = inner_products(keys.to(program.dtype) ** 2, (program / unit)[None] ** 2)[..., 0]
        return safe_sqrt(squares) * unit.to(torch.float64)
