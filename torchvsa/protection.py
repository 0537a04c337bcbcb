"""Protection: permutations that make similar hypervectors dissimilar before they are bundled.

Neubert et al. protect every condition, so that conditions with common sensor values do not interfere. A protection has
two methods: `protect(x)` and `protect.invert(y)`.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Literal

import torch
from jaxtyping import Int, Shaped
from torch import Tensor

from torchvsa._blocks import by_blocks
from torchvsa._checks import whole_number
from torchvsa._kernels.index_digits import digit_count, index_digits
from torchvsa._memory_limit import require_memory
from torchvsa._numerics import as_bipolar, inner_products, is_integer
from torchvsa.architectures import VSA
from torchvsa.errors import ShapeError
from torchvsa.part import Layout, Part
from torchvsa.registry import Registry


class Protection(Part):
    """A map of hypervectors, `[..., d] -> [..., d]`, with an exact or estimated inverse.

    A new protection implements `forward` and `invert`, and what `Part` asks for.
    """

    @abstractmethod
    def forward(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Protect `x`."""

    @abstractmethod
    def invert(self, y: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Recover `x` from `y = protect(x)`."""

    def own_layout(self) -> Layout:
        """No tensors."""
        return {}

    def _draw(self, generator: torch.Generator | None) -> Mapping[str, Tensor]:
        return {}

    def config(self) -> dict[str, Any]:
        """The name."""
        return {"name": self.name}


class Unprotected(Protection):
    """No protection: similar conditions stay similar, so that a program can generalise between them."""

    name = "none"

    def __init__(self, vsa: VSA) -> None:
        super().__init__()
        self.vsa = vsa
        self._own(None)

    def forward(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """`x` itself."""
        return x

    def invert(self, y: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """`y` itself."""
        return y


class FixedShift(Protection):
    """Rotates every hypervector to the right by the same `shift`, which keeps all similarities."""

    name = "fixed_shift"

    def __init__(self, vsa: VSA, shift: int = 1) -> None:
        super().__init__()
        self.vsa = vsa
        self.shift = whole_number(shift, "the shift of a fixed shift is a whole number")
        self._own(None)

    def forward(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Rotate to the right by `shift`."""
        return self.vsa.permute(x, self.shift)

    def invert(self, y: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Rotate back."""
        return self.vsa.permute(y, -self.shift)

    def config(self) -> dict[str, Any]:
        """The name and the shift."""
        return {"name": self.name, "shift": self.shift}


class SelfShift(Protection):
    """Rotates each hypervector by a width w(x) derived from itself, and bundles in a hypervector that encodes w.

        protect(x) = permute(bundle([x, h]), w(x))

    `h` is one random hypervector. `permute(h, w)` encodes the width w: the d codes are nearly orthogonal, and only `h`
    is stored.

    | `width` | w | |
    |---|---|---|
    | `"mean"` | average index of the elements > 0, rounded half up | as published; about √(d/12) widths around d/2 |
    | `"sum"` | sum of those indices, mod d | uniform over all d widths |

    Widths are exact integer sums and do not depend on batch size, type or device. Without an element above 0 the width
    is 0.

    Acts as a hash: conditions that differ in one of three sensors become nearly unrelated.
    Source: Neubert et al. 2016, section II.
    """

    name = "self_shift"
    h: Tensor
    index_digits: Tensor
    digit_values: Tensor

    def __init__(
        self,
        vsa: VSA,
        width: Literal["mean", "sum"] = "mean",
        seed: int | None = None,
        h: Shaped[Tensor, "d"] | None = None,
    ) -> None:
        super().__init__()
        self.vsa = vsa
        if width not in ("mean", "sum"):
            raise ValueError(f"the width of a self-derived shift is 'mean' or 'sum'; got {width!r}")
        self.width_rule = width
        count = digit_count(vsa.dim)
        # `derive` computes in int64 and holds three such tensors.
        require_memory(8 * (3 * count + 2) * vsa.dim, f"a self-derived shift of d = {vsa.dim}", "take fewer dimensions")
        if h is not None and h.shape != (vsa.dim,):
            raise ShapeError(f"h must be one hypervector of d = {vsa.dim} elements; got shape {tuple(h.shape)}")
        if h is not None and h.dtype != vsa.dtype:
            raise ValueError(f"h must be a hypervector of {vsa}; got {h.dtype}")
        self.register_buffer("index_digits", None, persistent=False)
        self.register_buffer("digit_values", None, persistent=False)
        self._own(seed if h is None else None)
        if h is not None:
            self.h = h
            self.derive()

    def derive(self) -> None:
        """Compute the digits of all indices, from which `width` sums; they depend only on d."""
        digits, self.digit_values = index_digits(self.vsa.dim, self.h.device)
        self.index_digits = torch.cat([torch.ones_like(digits[:1]), digits])

    def own_layout(self) -> Layout:
        """`h` `[d]`."""
        return {"h": (self.vsa.dtype, (self.vsa.dim,))}

    def _draw(self, generator: torch.Generator | None) -> Mapping[str, Tensor]:
        return {"h": self.vsa.random(generator=generator)}

    def width(self, x: Shaped[Tensor, "*batch d"]) -> Int[Tensor, "*batch"]:
        """The shift width of each vector, an integer in [0, d)."""
        rows = x.reshape(-1, self.vsa.dim)
        sums = by_blocks(self._sums, rows, row_bytes=self.vsa.dim).reshape(*x.shape[:-1], len(self.index_digits))
        sums = sums.to(torch.int64)
        count, total = sums[..., 0], (sums[..., 1:] * self.digit_values).sum(-1)
        if self.width_rule == "sum":
            return total % self.vsa.dim
        return (2 * total + count) // (2 * count).clamp(min=1)

    def _sums(self, rows: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch digits"]:
        """The number of elements above 0, and the sum of each digit of their indices."""
        if is_integer(rows) and rows.dtype != torch.bool:
            marks = rows.clamp(0, 1).to(torch.int8)  # equals `> 0` for integers, and is several times faster
        else:
            marks = self.vsa.positive(rows).to(torch.int8)
        return inner_products(marks, self.index_digits)

    def forward(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Bundle `x` with `h`, then rotate by the width of `x`."""
        self.vsa.check(x, "x")
        self._require_drawn()
        # In blocks, rows stay in the cache between the steps.
        rows = by_blocks(self._protected, x.reshape(-1, self.vsa.dim), row_bytes=4 * self.vsa.dim * x.element_size())
        return rows.reshape(x.shape)

    def _protected(self, rows: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
        return self.vsa.permute(self.vsa._bundle_pair(rows, self.h.to(rows.dtype)), self.width(rows))

    def decode(self, y: Shaped[Tensor, "*batch d"]) -> Int[Tensor, "*batch"]:
        """The width encoded in `y = protect(x)`: the shift at which `h` correlates best with `y`."""
        if y.numel() == 0:
            # The Fourier transform refuses an empty batch.
            return torch.zeros(y.shape[:-1], dtype=torch.int64, device=y.device)
        spectrum, reference = (torch.fft.fft(_floats(v)) for v in (y, self.h))
        return torch.fft.ifft(spectrum * reference.conj()).real.argmax(-1)

    def invert(self, y: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Decode the width, rotate back and remove `h`.

        Exact for x of -1 / +1 in MAP-C and MAP-I, exact up to rounding in FHRR. Otherwise an estimate that is similar
        to x.
        """
        return self.vsa.unbundle(self.vsa.permute(y, -self.decode(y)), self.h.to(y.dtype))

    def config(self) -> dict[str, Any]:
        """The name and the rule of the width; `h` is a tensor."""
        return {"name": self.name, "width": self.width_rule}


def _floats(x: Tensor) -> Tensor:
    x = as_bipolar(x)
    return x.to(torch.float32) if is_integer(x) else x


PROTECTIONS: Registry[type[Protection]] = Registry(
    "protection", {p.name: p for p in (SelfShift, FixedShift, Unprotected)}
)


def protection(config: Mapping[str, Any], vsa: VSA) -> Protection:
    """Make the protection that `config()` describes, without drawn tensors."""
    return PROTECTIONS.find(config.get("name")).from_config(config, vsa)
