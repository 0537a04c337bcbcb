"""A sensor and an actuator: a name, what it reads or is told, and a unit."""

import math
import operator
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal

import numpy as np

_MOST_LEVELS = 2**31
_SHOWN = 10
"""So many values are listed in an error."""
_ULPS = 4
"""Neighbouring bins and levels are at least so many floats apart: rounding moves a value by at most 2 of them."""


def _bound(part: "Sensor | Actuator", kind: str, which: str) -> int | float:
    """The bound `low` or `high` as a plain number."""
    given = getattr(part, which)
    value = _plain(given)
    if value is None:
        raise ValueError(f"{kind} {part.name!r}: {which} must be a real number; got {given!r}")
    return value


def _plain(given: Any) -> int | float | None:
    """A real number as a plain one; None for anything else, truth values included."""
    value = given.item() if getattr(given, "ndim", None) == 0 else given
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    return value if isinstance(value, int | float) else float(value)


def _check_part(part: "Sensor | Actuator", kind: str) -> None:
    """Raise unless a sensor or actuator has a name and a unit."""
    if not isinstance(part.name, str) or not part.name:
        raise ValueError(f"every {kind} needs a name, a string; got {part.name!r}")
    if not isinstance(part.unit, str):
        raise ValueError(f"{kind} {part.name!r}: unit must be a string; got {part.unit!r}")


def _check_range(part: "Sensor | Actuator", kind: str) -> None:
    """Raise unless a sensor or actuator has a range; keep its bounds as plain numbers."""
    low, high = (_bound(part, kind, which) for which in ("low", "high"))
    try:
        width = float(high) - float(low)
    except OverflowError:
        width = math.nan
    if not (math.isfinite(width) and width > 0):
        raise ValueError(
            f"{kind} {part.name!r} needs a finite range with low < high, whose width high - low is finite as well; "
            f"got [{part.low}, {part.high}]"
        )
    object.__setattr__(part, "low", low)
    object.__setattr__(part, "high", high)


def most_parts(low: float, high: float) -> float:
    """The most parts of equal width in which float64 can tell the values of a range apart."""
    width = high - low
    # Positions are computed as (value - low) * parts, which has to be finite too.
    return min(width / (_ULPS * math.ulp(max(abs(low), abs(high)))), sys.float_info.max / width)


@dataclass(frozen=True)
class Sensor:
    """A sensor by its name and what it reads; NaN means that it was not observed.

    | kind | what it reads | what to give |
    |---|---|---|
    | `"real"` | numbers in `[low, high]` | `low` and `high` |
    | `"angle"` | any finite number: `low` and `high` are the same direction, and it wraps around | `low` and `high` |
    | `"binary"` | 0 and 1, or False and True | nothing |
    | `"categorical"` | one of `values`, in no order | `values` |

        Sensor("distance", 0, 4, unit="m")
        Sensor("heading", -180, 180, unit="deg", kind="angle")
        Sensor("bumper", kind="binary")
        Sensor("gear", kind="categorical", values=("low", "high", "reverse"))

    `values` are all text, or all numbers. Numbers are read as they are. Text is read as text, or as its index in
    `values` (0 for the first one): tensors hold numbers only. A real reading outside the range is an error
    (`out_of_range="error"`) or becomes the nearest bound (`"clip"`). For binary and categorical sensors `low` and
    `high` are the least and the greatest number that they read.

    Raises `ValueError`, naming the sensor, for what makes no sense.
    """

    name: str
    low: float = math.nan
    high: float = math.nan
    unit: str = ""
    out_of_range: Literal["error", "clip"] = "error"
    kind: Literal["real", "angle", "binary", "categorical"] = "real"
    values: Sequence[str] | Sequence[float] = ()

    def __post_init__(self) -> None:
        _check_part(self, "sensor")
        if self.kind not in ("real", "angle", "binary", "categorical"):
            raise ValueError(
                f"sensor {self.name!r}: kind is 'real', 'angle', 'binary' or 'categorical'; got {self.kind!r}"
            )
        if self.out_of_range not in ("error", "clip"):
            raise ValueError(f"sensor {self.name!r}: out_of_range is 'error' or 'clip'; got {self.out_of_range!r}")
        if self.kind != "real" and self.out_of_range != "error":
            raise ValueError(
                f"sensor {self.name!r}: only real sensors have a nearest bound, out_of_range={self.out_of_range!r}"
            )
        object.__setattr__(self, "values", self._checked_values())
        if self.choices:
            self._take_range(min(self.choices), max(self.choices))
        else:
            _check_range(self, "sensor")

    @property
    def choices(self) -> tuple[float, ...]:
        """The numbers that a binary or categorical sensor reads, indices for text; none for the other kinds."""
        if self.kind == "binary":
            return 0, 1
        return tuple(place if isinstance(value, str) else value for place, value in enumerate(self.values))

    @property
    def labels(self) -> dict[str, int]:
        """The index of each value that is text."""
        return {value: place for place, value in enumerate(self.values) if isinstance(value, str)}

    def described(self) -> str:
        """What the sensor reads, in words for errors."""
        unit = f" {self.unit}" if self.unit else ""
        if self.kind == "binary":
            return "it is binary: 0 or 1, False or True"
        if self.kind == "angle":
            return f"it is an angle: any finite number, of which {self.low:g} and {self.high:g}{unit} are the same"
        if not self.values:
            return f"its range is [{self.low:g}, {self.high:g}]{unit}"
        shown = ", ".join(map(repr, self.values[:_SHOWN]))
        shown += f", ... ({len(self.values)} in all)" if len(self.values) > _SHOWN else ""
        return f"its values are {shown}{unit}" + (f", or their indices 0 to {self.high}" if self.labels else "")

    def _checked_values(self) -> tuple[str, ...] | tuple[float, ...]:
        given, who = self.values, f"sensor {self.name!r}"
        if isinstance(given, str) or not hasattr(given, "__iter__") or getattr(given, "ndim", 1) != 1:
            raise ValueError(f"{who}: values are a sequence such as ('low', 'high'); got {given!r:.200}")
        values = tuple(given)
        if self.kind != "categorical":
            if values:
                raise ValueError(f"{who}: only a categorical sensor has values; this one is {self.kind!r}")
            return ()
        if len(values) < 2:
            raise ValueError(f"{who} is categorical and needs at least two values; got {list(values)}")
        texts = tuple(str(value) for value in values if isinstance(value, str))
        numbers = tuple(number for value in values if (number := _plain(value)) is not None)
        if len(values) not in (len(texts), len(numbers)):
            raise ValueError(f"{who}: values are all text, or all real numbers; got {list(values)!r:.200}")
        # As float64, the type of all readings.
        different = len(set(texts) or {_finite(number) for number in numbers})
        if different < len(values) or not all(math.isfinite(_finite(number)) for number in numbers):
            raise ValueError(f"{who}: values must be finite and differ from each other; got {list(values)!r:.200}")
        return texts or numbers

    def _take_range(self, low: float, high: float) -> None:
        """Set the range that follows from what is read. Raises `ValueError` if another one was given."""
        for which, value in (("low", low), ("high", high)):
            given = getattr(self, which)
            left_out = isinstance(given, float) and math.isnan(given)
            if not left_out and _plain(given) != value:
                raise ValueError(
                    f"sensor {self.name!r} is {self.kind}, and has no range of its own; leave out {which}={given!r}"
                )
            object.__setattr__(self, which, value)


def _finite(number: float) -> float:
    """A number in float64; infinity where it is too large for it."""
    try:
        return float(number)
    except OverflowError:
        return math.inf


@dataclass(frozen=True)
class Actuator:
    """A motor with commands in `[low, high]`, told apart at `levels` evenly spaced values, both ends among them."""

    name: str
    low: float
    high: float
    unit: str = ""
    levels: int = 21

    def __post_init__(self) -> None:
        _check_part(self, "actuator")
        _check_range(self, "actuator")
        try:
            levels = -1 if isinstance(self.levels, bool | np.bool_) else operator.index(self.levels)
        except TypeError:
            levels = -1
        if not 2 <= levels <= _MOST_LEVELS:
            raise ValueError(
                f"actuator {self.name!r} needs at least 2 levels; got {self.levels!r}, expected a whole number from 2 "
                "to 2^31"
            )
        object.__setattr__(self, "levels", levels)
        if levels - 1 > most_parts(self.low, self.high):
            raise ValueError(
                f"actuator {self.name!r}: {levels} levels of the range [{self.low}, {self.high}] cannot be told apart "
                "in float64; take fewer, or a range of another width or nearer to 0"
            )
