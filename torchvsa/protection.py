"""Protection: a permutation that hides a hypervector's structure from the vectors it is bundled with.

The paper protects every condition, so that conditions which share sensor values do not blur each other. A
protection has two verbs: `protect(x)` and `protect.invert(y)`.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Literal

import torch
from jaxtyping import Int, Shaped
from torch import Tensor

from torchvsa._blocks import by_blocks
from torchvsa._checks import whole_number
from torchvsa._memory_limit import require_memory
from torchvsa._numerics import as_bipolar, inner_products, is_integer
from torchvsa.architectures import VSA
from torchvsa.errors import ShapeError
from torchvsa.part import Layout, Part
from torchvsa.registry import Registry


class Protection(Part):
    """A map of hypervectors to hypervectors `[..., d] -> [..., d]`, with an inverse (exact or estimated)."""

    @abstractmethod
    def forward(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Protect `x`."""

    @abstractmethod
    def invert(self, y: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Recover `x` from `y = protect(x)`."""

    def own_layout(self) -> Layout:
        """Nothing of its own."""
        return {}

    def _draw(self, generator: torch.Generator | None) -> Mapping[str, Tensor]:
        return {}

    def config(self) -> dict[str, Any]:
        """See `Part.config`."""
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
    """A circular right shift by the same `shift` for all: quotes a vector, keeps every similarity."""

    name = "fixed_shift"

    def __init__(self, vsa: VSA, shift: int = 1) -> None:
        super().__init__()
        self.vsa = vsa
        self.shift = whole_number(shift, "the shift of a fixed shift is a whole number")
        self._own(None)

    def forward(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Shift to the right."""
        return self.vsa.permute(x, self.shift)

    def invert(self, y: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Shift back."""
        return self.vsa.permute(y, -self.shift)

    def config(self) -> dict[str, Any]:
        """See `Part.config`."""
        return {"name": self.name, "shift": self.shift}


class SelfShift(Protection):
    """The paper's: shift by a width `w` computed from the vector itself, and superpose the name of `w`.

        protect(x) = shift(bundle(x, h), w(x))

    for one random hypervector `h`: the name of the width is `H[w] = shift(h, w)`, so that all d names cost d
    numbers and are near-orthogonal.

    | `width` | w | |
    |---|---|---|
    | `"mean"` | average index of the elements > 0, rounded half up | the paper's; about √(d/12) widths around d/2 |
    | `"sum"` | sum of those indices, mod d | spreads evenly over all d widths |

    Widths come from exact integer sums, so they do not depend on batch size, type or device. No element
    above 0 gives width 0.

    It acts as a hash: conditions that differ in one of three sensors become all but unrelated.
    Source: Neubert et al. 2016, section II.
    """

    name = "self_shift"
    h: Tensor
    columns: Tensor
    places: Tensor

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
        count = _places(vsa.dim)
        # The columns are computed in int64, in three steps.
        require_memory(8 * (3 * count + 2) * vsa.dim, f"a self-derived shift of d = {vsa.dim}", "take fewer dimensions")
        if h is not None and h.shape != (vsa.dim,):
            raise ShapeError(f"h must be one hypervector of d = {vsa.dim} elements; got shape {tuple(h.shape)}")
        if h is not None and h.dtype != vsa.dtype:
            raise ValueError(f"h must be a hypervector of {vsa}; got {h.dtype}")
        self.register_buffer("columns", None, persistent=False)
        self.register_buffer("places", None, persistent=False)
        self._own(seed if h is None else None)
        if h is not None:
            self.h = h
            self.derive()

    def derive(self) -> None:
        """Compute the columns that find widths, which depend on the number of dimensions alone."""
        # Indices in base 128, so that their sums are exact products of int8 on any device.
        dim, device = self.vsa.dim, self.h.device
        places = 128 ** torch.arange(_places(dim), device=device)
        digits = torch.arange(dim, device=device) // places[:, None] % 128
        ones = torch.ones(1, dim, dtype=torch.int64, device=device)
        self.columns, self.places = torch.cat([ones, digits]).to(torch.int8), places

    def own_layout(self) -> Layout:
        """`h` `[d]`."""
        return {"h": (self.vsa.dtype, (self.vsa.dim,))}

    def _draw(self, generator: torch.Generator | None) -> Mapping[str, Tensor]:
        return {"h": self.vsa.random(generator=generator)}

    def width(self, x: Shaped[Tensor, "*batch d"]) -> Int[Tensor, "*batch"]:
        """The shift width of each vector, an integer in [0, d)."""
        rows = x.reshape(-1, self.vsa.dim)
        sums = by_blocks(self._sums, rows, row_bytes=self.vsa.dim).reshape(*x.shape[:-1], len(self.columns))
        sums = sums.to(torch.int64)
        count, total = sums[..., 0], (sums[..., 1:] * self.places).sum(-1)
        if self.width_rule == "sum":
            return total % self.vsa.dim
        return (2 * total + count) // (2 * count).clamp(min=1)

    def _sums(self, rows: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch columns"]:
        """How many elements are > 0, and the sums of the digits of their indices."""
        if is_integer(rows) and rows.dtype != torch.bool:
            marks = rows.clamp(0, 1).to(torch.int8)  # several times faster than comparing, and the same for integers
        else:
            marks = self.vsa.positive(rows).to(torch.int8)
        return inner_products(marks, self.columns)

    def forward(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Superpose `x` with `h`, then shift by the width of `x`."""
        self.vsa.check(x, "x")
        self._require_drawn()
        # In blocks, rows stay in the cache between the steps.
        rows = by_blocks(self._protected, x.reshape(-1, self.vsa.dim), row_bytes=4 * self.vsa.dim * x.element_size())
        return rows.reshape(x.shape)

    def _protected(self, rows: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
        return self.vsa.permute(self.vsa._bundle_pair(rows, self.h.to(rows.dtype)), self.width(rows))

    def decode(self, y: Shaped[Tensor, "*batch d"]) -> Int[Tensor, "*batch"]:
        """The width hidden in `y = protect(x)`: the shift at which `h` correlates best with `y`."""
        if y.numel() == 0:
            # The Fourier transform refuses an empty batch.
            return torch.zeros(y.shape[:-1], dtype=torch.int64, device=y.device)
        spectrum, reference = (torch.fft.fft(_floats(v)) for v in (y, self.h))
        return torch.fft.ifft(spectrum * reference.conj()).real.argmax(-1)

    def invert(self, y: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Decode the width, shift back and take `h` out.

        Exact for bipolar x in MAP-C and MAP-I (where the superposition is 0, x = -h), up to rounding in
        FHRR; an estimate, similar to x, for other x and in the other architectures.
        """
        return self.vsa.unbundle(self.vsa.permute(y, -self.decode(y)), self.h.to(y.dtype))

    def config(self) -> dict[str, Any]:
        """See `Part.config`; `h` itself is a tensor."""
        return {"name": self.name, "width": self.width_rule}


def _places(dim: int) -> int:
    """Digits in base 128 of the largest index."""
    places = 1
    while 128**places < dim:
        places += 1
    return places


def _floats(x: Tensor) -> Tensor:
    x = as_bipolar(x)
    return x.to(torch.float32) if is_integer(x) else x


PROTECTIONS: Registry[type[Protection]] = Registry(
    "protection", {p.name: p for p in (SelfShift, FixedShift, Unprotected)}
)


def protection(config: Mapping[str, Any], vsa: VSA) -> Protection:
    """The protection that a `config()` describes, as a plan."""
    return PROTECTIONS.find(config.get("name")).from_config(config, vsa)
