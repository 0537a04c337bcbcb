"""Options as plain numbers, refused when they are given if they cannot work."""

import math
from numbers import Integral, Real
from typing import Any

import numpy as np


def whole(name: str, value: Any, least: int, most: float = math.inf) -> int:
    """A whole number as a plain int; NumPy's integers are accepted.

    Raises `ValueError`, naming the option and what is allowed, for a number out of range and for any other type, bools
    and floats included.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or not least <= int(value) <= most:
        raise ValueError(f"{name} is a whole number {_range(least, most)}; got {value!r}")
    return int(value)


def number(name: str, value: Any, least: float = -math.inf, *, above: bool = False, below: float = math.inf) -> float:
    """A finite number from `least` on (with `above`, above it) and less than `below`, as a plain float.

    NumPy's numbers are accepted. Raises `ValueError`, naming the option and what is allowed, for NaN, infinity, a
    number out of range, and any other type, bools and strings included.
    """
    if isinstance(value, Real) and not isinstance(value, bool):
        try:
            plain = float(value)
        except OverflowError:
            plain = math.inf
        if math.isfinite(plain) and least <= plain < below and not (above and plain == least):
            return plain
    limits = "" if least == -math.inf else f" above {least:g}" if above else f" of at least {least:g}"
    limits += "" if below == math.inf else f" and below {below:g}"
    raise ValueError(f"{name} is a finite number{limits}; got {value!r}")


def flag(name: str, value: Any) -> bool:
    """True or False as a plain bool; NumPy's are accepted. Raises `ValueError` for anything else."""
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} is True or False; got {value!r}")
    return bool(value)


def store(options: object, **checked: Any) -> None:
    """Set fields of a frozen dataclass, in its `__post_init__`, to the values that were checked."""
    for name, value in checked.items():
        object.__setattr__(options, name, value)


def _range(least: int, most: float) -> str:
    return f"from {least} on" if most == math.inf else f"from {least} to {most}"
