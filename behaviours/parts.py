"""A sensor and an actuator: a name, a range and a unit."""

import math
import operator
import sys
from dataclasses import dataclass
from numbers import Real
from typing import Literal

import numpy as np

_MOST_LEVELS = 2**31
_ULPS = 4
"""Neighbouring bins and levels are at least so many floats apart: rounding moves a value by at most 2 of them."""


def _bound(part: "Sensor | Actuator", kind: str, which: str) -> int | float:
    """The bound `low` or `high` as a plain number."""
    given = getattr(part, which)
    value = given.item() if getattr(given, "ndim", None) == 0 else given
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ValueError(f"{kind} {part.name!r}: {which} must be a real number; got {given!r}")
    return value if isinstance(value, int | float) else float(value)


def _check_part(part: "Sensor | Actuator", kind: str) -> None:
    """Raise unless a sensor or actuator has a name and a range; keep its bounds as plain numbers."""
    if not isinstance(part.name, str) or not part.name:
        raise ValueError(f"every {kind} needs a name, a string; got {part.name!r}")
    if not isinstance(part.unit, str):
        raise ValueError(f"{kind} {part.name!r}: unit must be a string; got {part.unit!r}")
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
    """A real-valued sensor with readings in `[low, high]`; NaN means that it was not observed.

    `beyond` says what becomes of a reading outside the range: an error, or the nearest bound.
    """

    name: str
    low: float
    high: float
    unit: str = ""
    beyond: Literal["error", "clip"] = "error"

    def __post_init__(self) -> None:
        _check_part(self, "sensor")
        if self.beyond not in ("error", "clip"):
            raise ValueError(f"sensor {self.name!r}: beyond is 'error' or 'clip'; got {self.beyond!r}")


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
