"""Sensors and actuators: names, ranges and units."""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal

from behaviours.options import as_int

_MOST_LEVELS = 2**31
_MAX_LISTED = 10
"""The most values that an error lists."""
_ULPS = 4
"""The least distance of neighbouring bins and levels, in units in the last place: rounding moves a value by up to 2."""


def _bound(part: "Sensor | Actuator", kind: str, which: str) -> int | float:
    """The bound `low` or `high` as a Python number."""
    given = getattr(part, which)
    value = _plain(given)
    if value is None:
        raise ValueError(f"{kind} {part.name!r}: {which} must be a real number; got {given!r}")
    return value


def _plain(given: Any) -> int | float | None:
    """A real number as a Python number; None for anything else, including bools."""
    value = given.item() if getattr(given, "ndim", None) == 0 else given
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    return value if isinstance(value, int | float) else float(value)


def _check_part(part: "Sensor | Actuator", kind: str) -> None:
    """Raise `ValueError` unless a sensor or actuator has a name and a unit."""
    if not isinstance(part.name, str) or not part.name:
        raise ValueError(f"every {kind} needs a name, a string; got {part.name!r}")
    if not isinstance(part.unit, str):
        raise ValueError(f"{kind} {part.name!r}: unit must be a string; got {part.unit!r}")


def _check_range(part: "Sensor | Actuator", kind: str) -> None:
    """Raise `ValueError` unless a sensor or actuator has a range; store its bounds as Python numbers."""
    low, high = (_bound(part, kind, which) for which in ("low", "high"))
    try:
        width = float(high) - float(low)
    except OverflowError:
        width = math.nan
    if not (math.isfinite(width) and width > 0):
        raise ValueError(
            f"{kind} {part.name!r} needs a finite range with low < high, whose width high - low is finite too; "
            f"got [{part.low}, {part.high}]"
        )
    object.__setattr__(part, "low", low)
    object.__setattr__(part, "high", high)


def most_parts(low: float, high: float) -> float:
    """The largest number of equal parts of a range whose values differ in float64."""
    width = high - low
    # Positions are computed as (value - low) * parts, which must be finite too.
    return min(width / (_ULPS * math.ulp(max(abs(low), abs(high)))), sys.float_info.max / width)


@dataclass(frozen=True)
class Sensor:
    """A sensor: its name, the values that it reads, and their unit. A reading of NaN was not observed.

    | kind | readings | arguments |
    |---|---|---|
    | `"real"` | numbers in `[low, high]` | `low` and `high` |
    | `"angle"` | any finite number, modulo the range: `low` and `high` are the same direction | `low` and `high` |
    | `"binary"` | 0 and 1, or False and True | none |
    | `"categorical"` | one of `values`, unordered | `values` |

        Sensor("distance", 0, 4, unit="m")
        Sensor("heading", -180, 180, unit="deg", kind="angle")
        Sensor("bumper", kind="binary")
        Sensor("gear", kind="categorical", values=("low", "high", "reverse"))

    `values` are all strings or all numbers. A reading of a sensor with string values is the string, or its index in
    `values` (0 for the first one), since tensors hold only numbers. A real reading outside the range is an error
    (`out_of_range="error"`) or becomes the nearest bound (`"clip"`). For binary and categorical sensors `low` and
    `high` are set to the smallest and the largest reading.

    Raises `ValueError`, naming the sensor, for arguments that do not fit its kind.
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
        """The readings of a binary or categorical sensor as numbers, indices for strings; empty for other kinds."""
        if self.kind == "binary":
            return 0, 1
        return tuple(index if isinstance(value, str) else value for index, value in enumerate(self.values))

    @property
    def labels(self) -> dict[str, int]:
        """The index of each string in `values`."""
        return {value: index for index, value in enumerate(self.values) if isinstance(value, str)}

    def describe(self) -> str:
        """The valid readings in words, for error messages."""
        unit = f" {self.unit}" if self.unit else ""
        if self.kind == "binary":
            return "it is binary: 0 or 1, False or True"
        if self.kind == "angle":
            return f"it is an angle: any finite number, of which {self.low:g} and {self.high:g}{unit} are the same"
        if not self.values:
            return f"its range is [{self.low:g}, {self.high:g}]{unit}"
        shown = ", ".join(map(repr, self.values[:_MAX_LISTED]))
        shown += f", ... ({len(self.values)} in all)" if len(self.values) > _MAX_LISTED else ""
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
            raise ValueError(f"{who}: values are all strings, or all real numbers; got {list(values)!r:.200}")
        # As float64, the type of all readings.
        distinct = len(set(texts) or {_finite(number) for number in numbers})
        if distinct < len(values) or not all(math.isfinite(_finite(number)) for number in numbers):
            raise ValueError(f"{who}: values must be finite and differ from each other; got {list(values)!r:.200}")
        return texts or numbers

    def _take_range(self, low: float, high: float) -> None:
        """Set the range of the choices. Raises `ValueError` if another range was given."""
        for which, value in (("low", low), ("high", high)):
            given = getattr(self, which)
            left_out = isinstance(given, float) and math.isnan(given)
            if not left_out and _plain(given) != value:
                raise ValueError(
                    f"sensor {self.name!r} is {self.kind}, and its values define its range; leave out {which}={given!r}"
                )
            object.__setattr__(self, which, value)


def _finite(number: float) -> float:
    """A number as a float; infinity if it is too large."""
    try:
        return float(number)
    except OverflowError:
        return math.inf


@dataclass(frozen=True)
class Actuator:
    """A motor with commands in `[low, high]`, quantised to `levels` evenly spaced values including both ends."""

    name: str
    low: float
    high: float
    unit: str = ""
    levels: int = 21

    def __post_init__(self) -> None:
        _check_part(self, "actuator")
        _check_range(self, "actuator")
        levels = as_int(f"actuator {self.name!r}: levels", self.levels, 2, _MOST_LEVELS)
        object.__setattr__(self, "levels", levels)
        if levels - 1 > most_parts(self.low, self.high):
            raise ValueError(
                f"actuator {self.name!r}: {levels} levels of the range [{self.low}, {self.high}] cannot be told apart "
                "in float64; take fewer levels, or a wider range, or one nearer to 0"
            )


def span(part: Sensor | Actuator) -> str:
    """The range of a sensor or an actuator in words, such as `0 to 4 m`."""
    return f"{part.low:g} to {part.high:g}" + (f" {part.unit}" if part.unit else "")
