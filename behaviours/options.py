"""Check options when they are given, and convert them to plain Python numbers."""

import math
from numbers import Real
from typing import Any

import numpy as np

from torchvsa._checks import whole_number


def as_int(name: str, value: Any, least: int, most: float = math.inf) -> int:
    """`value` as an int from `least` to `most`, both included; NumPy integers are accepted.

    Raises `ValueError`, naming the option and what is allowed, for a number out of range and for any other type,
    including bools and floats.
    """
    limits = f"of at least {least}" if most == math.inf else f"from {least} to {most}"
    message = f"{name} is a whole number {limits}"
    plain = whole_number(value, message)
    if not least <= plain <= most:
        raise ValueError(f"{message}; got {value!r}")
    return plain


def as_float(name: str, value: Any, least: float = -math.inf, *, above: bool = False, below: float = math.inf) -> float:
    """`value` as a finite float of at least `least` (with `above`, above it) and below `below`.

    NumPy numbers are accepted. Raises `ValueError`, naming the option and what is allowed, for NaN, infinity, a number
    out of range and any other type, including bools and strings.
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


def as_bool(name: str, value: Any) -> bool:
    """`value` as a bool; NumPy bools are accepted. Raises `ValueError` for anything else."""
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} is True or False; got {value!r}")
    return bool(value)


def set_fields(options: object, **values: Any) -> None:
    """Set fields of a frozen dataclass in its `__post_init__`."""
    for name, value in values.items():
        object.__setattr__(options, name, value)
