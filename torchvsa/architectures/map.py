"""Multiply-Add-Permute: the architecture of the paper."""

from typing import Literal

import torch
from jaxtyping import Float, Int, Shaped
from torch import Tensor

from torchvsa._checks import narrowed, refuse_nan
from torchvsa._kernels.look_up import gather_reduce
from torchvsa._numerics import inner_products, is_integer, safe_sqrt, units, widened
from torchvsa.architectures._random import random_bits
from torchvsa.architectures._sums import multiplied, stacked
from torchvsa.architectures._ties import first_two
from torchvsa.architectures.base import VSA, Summands


class MAP(VSA):
    """Multiply-Add-Permute: bind is the product, bundle the sum, permute a rotation.

    | variant | atoms | bundle |
    |---|---|---|
    | C | in [-1, 1] (bipolar, or `atoms="uniform"`) | the sum, clipped to [-1, 1] |
    | B | -1 / +1 | the sign of the sum; a split vote is decided by `permute(bind(x1, x2), 1)` |
    | I | -1 / +1 | the sum |

    `dtype=torch.float32` is differentiable; `torch.int8` holds integer codes, exact and smallest, whose sums
    accumulate in int32. Codes in int8 must be -1, 0 or +1, which no verb checks: others may wrap around in `bind`,
    records and protections. `superpose`, `bundle` and `similarity` are right for any int8 numbers, as is every verb for
    accumulators in int32.

    Source: Gayler 1998; Neubert et al. 2016, section II (variant C).
    """

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
        self.self_inverse = atoms == "bipolar"

    def config(self) -> dict[str, str | int]:
        """See `VSA.config`; names the atoms too where they are not the default."""
        return super().config() | ({} if self.atoms == "bipolar" else {"atoms": self.atoms})

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """See `VSA.random`: bipolar -1 / +1 with equal chance, or uniform in [-1, 1]."""
        # Bits, codes made of them, and those in another type; or uniform numbers, twice moved.
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

    def bind(self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]) -> Shaped[Tensor, "*#batch d"]:
        """The element-wise product; its own inverse on -1 / +1.

        Two raw accumulators of integers are refused (`ValueError`) if a product does not fit their type, where values
        can be looked at: see `superpose`.
        """
        self.check(a, "a")
        self.check(b, "b")
        return multiplied(a, b)

    def unbind(
        self, bound: Shaped[Tensor, "*#batch d"], key: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """The element-wise product again: exact for keys of -1 / +1."""
        self.check(bound, "bound")
        self.check(key, "key")
        return multiplied(bound, key)

    def normalize(self, raw: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """C: clip to [-1, 1], keeping 0; integer codes are the nearest ones. I: the sum itself. B: the sign.

        A raw sum no longer knows its voters, so B decides its zeros by the sum's own signs, shifted by one.
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
        """See `VSA.bundle`; the variants differ as the class says."""
        xs, dim = stacked(xs, dim)
        raw = self.superpose(xs, dim, weights)
        if self.variant == "B" and (voters := first_two(xs, dim, weights)) is not None:
            return self._signs(raw, self.permute(self.bind(*voters), 1))
        return self.normalize(raw)

    def _bundle_entries(
        self, table: Shaped[Tensor, "k entries d"], places: Int[Tensor, "batch k"]
    ) -> Shaped[Tensor, "batch d"]:
        """See `VSA._bundle_entries`."""
        if self.variant != "C" or table.dtype != self._type_of_sums(len(table)):
            return super()._bundle_entries(table, places)
        return gather_reduce(table, places, Tensor.add_, clip=True)

    def _bind_entries(
        self, table: Shaped[Tensor, "k entries d"], places: Int[Tensor, "batch k"]
    ) -> Shaped[Tensor, "batch d"]:
        """See `VSA._bind_entries`."""
        return gather_reduce(table, places, Tensor.mul_)

    def _bundle_pair(
        self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """See `VSA._bundle_pair`."""
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

        C: exact for a bipolar x (where the sum is 0, x = -known). I: exact. B: where the bundle differs from
        `known`, x does too; elsewhere x is taken to agree, which is right for 3 of 4 elements in all.
        """
        if self.variant == "C":
            return torch.where(bundled == 0, -known, bundled)
        if self.variant == "I":
            return bundled - known
        return bundled

    def unbound_norm(self, program: Shaped[Tensor, "d"], keys: Shaped[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """The root of `key² · program²`: one product for the whole batch."""
        if is_integer(program):
            return safe_sqrt(inner_products(keys.to(torch.float64) ** 2, program.to(torch.float64)[None] ** 2)[..., 0])
        program = widened(program)
        unit = units(program)
        squares = inner_products(keys.to(program.dtype) ** 2, (program / unit)[None] ** 2)[..., 0]
        return safe_sqrt(squares) * unit.to(torch.float64)
