"""Check arguments: whole numbers, real numbers, and arrays of real numbers."""

from __future__ import annotations

import operator
from numbers import Real

import numpy as np
from numpy.typing import NDArray

_MAX = 2**63 - 1
"""Seeds and episodes are stored as int64."""


def whole_number(name: str, value: object, at_least: int = 0) -> int:
    """`value` as an int. Raises `ValueError` unless it is a whole number from `at_least` to 2^63 - 1."""
    try:
        number = at_least - 1 if isinstance(value, bool | np.bool_) else operator.index(value)  # pyright: ignore[reportArgumentType]
    except TypeError:
        number = at_least - 1
    if not at_least <= number <= _MAX:
        raise ValueError(f"{name} {value!r}; expected a whole number, {at_least} or more (and less than 2^63)")
    return number


def real_number(name: str, value: object) -> float:
    """`value` as a float. Raises `ValueError` unless it is a real number."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
        raise ValueError(f"{name} {value!r}; expected a real number")
    return float(value)


def real_rows(name: str, values: object) -> NDArray[np.float64]:
    """`values` as float64. Raises `ValueError` for complex numbers, text, and rows of unequal length."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name} cannot be read as numbers: {error}") from error
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} are of type {array.dtype}; expected real numbers")
    return array.astype(np.float64, copy=False)
