"""The interface of encoders: sensor readings in, hypervectors out."""

import copy
from abc import abstractmethod
from typing import Any, TypeVar

import torch
from jaxtyping import Float, Int64, Shaped
from torch import Tensor

from torchvsa._checks import readable, whole_number
from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA
from torchvsa.errors import ShapeError
from torchvsa.part import Layout, Part

P = TypeVar("P", bound=Part)
_ROUNDING = 2.0**-50
"""Covers the three roundings in float64 between a reading and its position among the bins."""

UNOBSERVED = -1
"""The cell of a reading that was not observed."""


class Encoder(Part):
    """Encode rows of `sensors` readings in [0, 1], NaN for *unobserved*, as hypervectors.

    Encoding has two steps. `cells` says what of a reading matters: readings with equal cells have equal hypervectors,
    so that equal ones are found before any algebra. `encode` turns cells into hypervectors. For encoders with finitely
    many inputs cells are integers, one per sensor and -1 for unobserved; for the others they are the readings
    themselves, with -1 for NaN (`discrete` tells which).

    A new encoder is a class like `Product`: it implements `cells` and `encode`, and what `Part` asks for.
    """

    sensors: int
    discrete: bool = True
    """Whether cells are integers."""

    @abstractmethod
    def cells(self, x: Float[Tensor, "batch w"]) -> Shaped[Tensor, "batch w"]:
        """What of each reading matters; values outside [0, 1] count as the nearest bound."""

    @abstractmethod
    def encode(self, cells: Shaped[Tensor, "batch w"]) -> Shaped[Tensor, "batch d"]:
        """The hypervector of each row of cells, which are taken as `cells` returns them, unchecked."""

    @property
    def width(self) -> int:
        """Columns of the input: one per sensor, for encoders without a memory."""
        return self.sensors

    def forward(self, x: Float[Tensor, "batch w"]) -> Shaped[Tensor, "batch d"]:
        """Encode each row of readings.

        Raises `ShapeError` unless rows have one column per sensor, and `ValueError` for readings outside of [0, 1]. (A
        compiled or exported graph cannot raise: there they count as the nearest bound.)
        """
        if x.dim() != 2 or x.shape[1] != self.width:
            raise ShapeError(f"readings must be [batch, {self.width}], one column per sensor; got {tuple(x.shape)}")
        check_range(x)
        self._require_drawn()
        return self.encode(self.cells(x))

    # -- what encoders with a memory change, see `History` ----------------------------------------------

    def windows(self, x: Float[Tensor, "N n"], episodes: Int64[Tensor, "N"]) -> Float[Tensor, "N w"]:
        """The inputs that recorded readings make; rows are the steps of one episode after the other."""
        return x

    def start(self, batch: int) -> Float[Tensor, "batch past n"]:
        """What is remembered before the first step, for each of `batch` robots: nothing."""
        return torch.empty(batch, 0, self.sensors, dtype=torch.float64)

    def step(
        self, x: Float[Tensor, "batch n"], past: Float[Tensor, "batch past n"]
    ) -> tuple[Float[Tensor, "batch w"], Float[Tensor, "batch past n"]]:
        """The inputs that these readings make after `past`, and what is remembered from now on."""
        return x, past


class ValueEncoder(Part):
    """Encode single readings in [0, 1] as hypervectors: shape `[...]` in, `[..., d]` out.

    As with `Encoder`, `cells` says what of a reading matters and `encode` makes hypervectors of it. A record takes one
    value encoder for all of its sensors, or one for each.
    """

    discrete: bool = True

    @abstractmethod
    def cells(self, x: Float[Tensor, "*batch"]) -> Shaped[Tensor, "*batch"]:
        """What of each reading matters, -1 for NaN; values outside [0, 1] count as the nearest bound."""

    @abstractmethod
    def encode(self, cells: Shaped[Tensor, "*batch"]) -> Shaped[Tensor, "*batch d"]:
        """The hypervector of each cell; none of them is unobserved."""

    def forward(self, x: Float[Tensor, "*batch"]) -> Shaped[Tensor, "*batch d"]:
        """Encode each reading. Raises `ValueError` for readings that are NaN or outside of [0, 1]."""
        check_range(x)
        if readable(x) and x.isnan().any():
            raise ValueError("a value that was not observed has no hypervector; records leave it out")
        self._require_drawn()
        return self.encode(self.cells(x))


class Binned(ValueEncoder):
    """A value encoder with one hypervector for each of `bins` bins of equal width.

    Bin b holds b / bins <= x < (b + 1) / bins; 1 itself is in the last one. A new one implements `_codes`.
    """

    codes: Tensor

    def __init__(self, vsa: VSA, bins: int, seed: int | None = None) -> None:
        super().__init__()
        self.vsa, self.bins = vsa, whole("bins", bins)
        self._own(seed)

    def own_layout(self) -> Layout:
        """`codes` `[bins, d]`."""
        return {"codes": (self.vsa.dtype, (self.bins, self.vsa.dim))}

    def config(self) -> dict[str, Any]:
        """See `Part.config`."""
        return {"name": self.name, "bins": self.bins}

    def cells(self, x: Float[Tensor, "*batch"]) -> Int64[Tensor, "*batch"]:
        """The bin of each reading."""
        return binned(x, self.bins)

    def encode(self, cells: Int64[Tensor, "*batch"]) -> Shaped[Tensor, "*batch d"]:
        """The code of each bin."""
        return self.codes[cells]

    @abstractmethod
    def _codes(self, generator: torch.Generator | None) -> Shaped[Tensor, "bins d"]:
        """Draw the code of each bin."""

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        require_memory(
            3 * self.bins * self.vsa.row_bytes,
            f"a codebook of {self.bins:,} bins at d = {self.vsa.dim:,}",
            "take fewer bins or dimensions",
        )
        return {"codes": self._codes(generator)}


def binned(x: Float[Tensor, "*batch"], bins: int | Int64[Tensor, "n"]) -> Int64[Tensor, "*batch"]:
    """The bin of each value among `bins` of equal width over [0, 1], -1 for NaN.

    `bins` may be a tensor with a number for each column, the last dimension of `x`.

    A value that is an edge but for rounding in its type (7 of a range of 25, in 25 bins) is in the bin above the edge.
    """
    rounding = max(_ROUNDING, torch.finfo(x.dtype).eps)
    if isinstance(bins, Tensor):
        # Not as integers times a float, whose product is of the default type.
        index = (x.to(torch.float64) * (bins.to(torch.float64) * (1 + rounding))).floor()
        index = index.clamp(min=0).minimum(bins.to(torch.float64) - 1)
    else:
        index = (x.to(torch.float64) * (bins * (1 + rounding))).floor().clamp(0, bins - 1)
    return torch.where(x.isnan(), float(UNOBSERVED), index).to(torch.int64)


def continuous(x: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """The values themselves, within [0, 1], -1 for NaN."""
    return torch.where(x.isnan(), float(UNOBSERVED), x.clamp(0, 1))


def check_range(x: Float[Tensor, "*batch"]) -> None:
    """Raise `ValueError` for a value outside of [0, 1]; NaN is none. Where values cannot be looked at, nothing is."""
    if not readable(x) or not ((x < 0) | (x > 1)).any():
        return
    place = ((x < 0) | (x > 1)).nonzero()[0].tolist()
    raise ValueError(
        f"encoders take readings in [0, 1], NaN for unobserved; got {x[tuple(place)].item():g} at {place} "
        "(Schema.normalise scales readings of any range)"
    )


def planned(part: P) -> P:
    """A copy of a plan, to be drawn by the part that takes it; a part that is drawn already is returned as it is."""
    return part if part.drawn else copy.deepcopy(part)


def whole(name: str, value: int, least: int = 1) -> int:
    """`value` as an int. Raises `ValueError` naming the option unless it is a whole number of at least `least`."""
    what = f"{name} is a whole number of at least {least}"
    number = whole_number(value, what)
    if number < least:
        raise ValueError(f"{what}; got {value!r}")
    return number
