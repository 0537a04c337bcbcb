"""The interface of encoders, which turn sensor readings into hypervectors."""

import copy
from abc import abstractmethod
from typing import Any, ClassVar, TypeVar

import torch
from jaxtyping import Bool, Float, Int64, Shaped
from torch import Tensor

from torchvsa._checks import readable, whole_number
from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA
from torchvsa.errors import ShapeError
from torchvsa.part import Layout, Part

P = TypeVar("P", bound=Part)
ROUNDING = 2.0**-50
"""Bounds the three roundings in float64 between a reading and its bin."""

UNOBSERVED = -1
"""The cell of a reading that was not observed."""


class Encoder(Part):
    """Encode rows of `sensors` readings in [0, 1], NaN for *unobserved*, as hypervectors.

    Encoding has two steps. `cells` maps readings to cells; readings with equal cells have equal hypervectors, so that
    duplicates are found before any algebra. `encode` turns cells into hypervectors. If `discrete`, cells are integers,
    one per sensor, and -1 for unobserved. Otherwise they are the readings themselves, with -1 for NaN.

    A new encoder implements `cells` and `encode`, and what `Part` asks for.
    """

    sensors: int
    discrete: bool = True
    """Whether cells are integers."""

    @abstractmethod
    def cells(self, x: Float[Tensor, "batch w"]) -> Shaped[Tensor, "batch w"]:
        """The cell of each reading; values outside [0, 1] count as the nearest bound."""

    @abstractmethod
    def encode(self, cells: Shaped[Tensor, "batch w"]) -> Shaped[Tensor, "batch d"]:
        """The hypervector of each row of cells, as `cells` returns them; they are not checked."""

    @property
    def width(self) -> int:
        """The number of input columns: one per sensor, for encoders without a memory."""
        return self.sensors

    def forward(self, x: Float[Tensor, "batch w"]) -> Shaped[Tensor, "batch d"]:
        """Encode each row of readings.

        Raises `ShapeError` unless rows have one column per sensor, and `ValueError` for readings outside [0, 1]. A
        compiled or exported graph cannot raise: there they count as the nearest bound.
        """
        if x.dim() != 2 or x.shape[1] != self.width:
            raise ShapeError(f"readings must be [batch, {self.width}], one column per sensor; got {tuple(x.shape)}")
        check_range(x)
        self._require_drawn()
        return self.encode(self.cells(x))

    def windows(self, x: Float[Tensor, "N n"], episodes: Int64[Tensor, "N"]) -> Float[Tensor, "N w"]:
        """The inputs for recorded readings `x`; encoders with a memory, like `History`, override it."""
        return x

    def start(self, batch: int) -> Float[Tensor, "batch past n"]:
        """The memory of `batch` robots before the first step: empty here."""
        return torch.empty(batch, 0, self.sensors, dtype=torch.float64)

    def step(
        self, x: Float[Tensor, "batch n"], past: Float[Tensor, "batch past n"]
    ) -> tuple[Float[Tensor, "batch w"], Float[Tensor, "batch past n"]]:
        """The inputs for readings `x` after `past`, and the memory after this step."""
        return x, past


class ValueEncoder(Part):
    """Encode single readings in [0, 1] as hypervectors: shape `[...]` in, `[..., d]` out.

    As in `Encoder`, `cells` maps readings to cells and `encode` turns cells into hypervectors. A record takes one value
    encoder for all of its sensors, or one per sensor.
    """

    discrete: bool = True

    @abstractmethod
    def cells(self, x: Float[Tensor, "*batch"]) -> Shaped[Tensor, "*batch"]:
        """The cell of each reading, -1 for NaN; values outside [0, 1] count as the nearest bound."""

    @abstractmethod
    def encode(self, cells: Shaped[Tensor, "*batch"]) -> Shaped[Tensor, "*batch d"]:
        """The hypervector of each cell; no cell may be -1."""

    def forward(self, x: Float[Tensor, "*batch"]) -> Shaped[Tensor, "*batch d"]:
        """Encode each reading. Raises `ValueError` for readings that are NaN or outside [0, 1]."""
        check_range(x)
        if readable(x) and x.isnan().any():
            raise ValueError("a value that was not observed (NaN) has no hypervector; records leave it out")
        self._require_drawn()
        return self.encode(self.cells(x))


class Binned(ValueEncoder):
    """A value encoder with one hypervector for each of `bins` bins of equal width.

    Bin b holds b / bins <= x < (b + 1) / bins; 1 is in the last bin. A subclass implements `_codes`.
    """

    negates: ClassVar[bool] = False
    """Whether codes consist of elements and their negatives, for which the architecture must be `negatable`."""
    codes: Tensor

    def __init__(self, vsa: VSA, bins: int, seed: int | None = None) -> None:
        super().__init__()
        if self.negates:
            require_negatable(vsa, type(self).__name__)
        self.vsa, self.bins = vsa, whole("bins", bins)
        self._own(seed)

    def own_layout(self) -> Layout:
        """`codes` `[bins, d]`."""
        return {"codes": (self.vsa.dtype, (self.bins, self.vsa.dim))}

    def config(self) -> dict[str, Any]:
        """The name and the number of bins."""
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

    `bins` may be a tensor with one number per column (the last dimension of `x`). A value that equals an edge up to
    rounding in its type (7 of a range of 25, in 25 bins) is in the bin above the edge.
    """
    rounding = max(ROUNDING, torch.finfo(x.dtype).eps)
    if isinstance(bins, Tensor):
        # Integers times a Python float would be of the default dtype.
        index = (x.to(torch.float64) * (bins.to(torch.float64) * (1 + rounding))).floor()
        index = index.clamp(min=0).minimum(bins.to(torch.float64) - 1)
    else:
        index = (x.to(torch.float64) * (bins * (1 + rounding))).floor().clamp(0, bins - 1)
    return torch.where(x.isnan(), float(UNOBSERVED), index).to(torch.int64)


def continuous(x: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """The values, clamped to [0, 1], and -1 for NaN."""
    within = x.clamp(0, 1)
    if torch.compiler.is_exporting():
        # The optimiser of ONNX graphs joins two clamps of one tensor, as of encoders side by side, to an invalid graph.
        within = torch.where(x > 1, 1.0, torch.where(x < 0, 0.0, x))
    return torch.where(x.isnan(), float(UNOBSERVED), within)


def check_range(x: Float[Tensor, "*batch"]) -> None:
    """Raise `ValueError` for a value outside [0, 1], except NaN. Does nothing where values are not readable."""
    if not readable(x) or not ((x < 0) | (x > 1)).any():
        return
    position = ((x < 0) | (x > 1)).nonzero()[0].tolist()
    raise ValueError(
        f"encoders take readings in [0, 1], NaN for unobserved; got {x[tuple(position)].item():g} at {position} "
        "(Schema.normalise scales readings of any range)"
    )


def negated_where(vsa: VSA, codes: Shaped[Tensor, "d"], where: Bool[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
    """A row of codes for each row of `where`, with the elements negated that it marks."""
    if codes.dtype == torch.bool:
        return codes ^ where
    return torch.where(where, vsa.negative(codes), codes)


def planned(part: P) -> P:
    """Copy a plan, so that the part that takes it can draw the copy; return a drawn part as it is."""
    return part if part.drawn else copy.deepcopy(part)


def require_negatable(vsa: VSA, encoder: str) -> None:
    """Raise `ValueError`, naming alternatives, unless hypervectors have negatives."""
    if not vsa.negatable:
        raise ValueError(
            f"{encoder} codes negate elements, which {vsa.name} cannot; take Level or Lookup codes in a record"
        )


def whole(name: str, value: int, least: int = 1) -> int:
    """`value` as an int. Raises `ValueError` that names the option unless it is a whole number >= `least`."""
    what = f"{name} is a whole number of at least {least}"
    number = whole_number(value, what)
    if number < least:
        raise ValueError(f"{what}; got {value!r}")
    return number
