"""Single columns of recorded data: as numbers, or as the indices of texts."""

import difflib
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from behaviours.parts import Sensor

Column = np.ndarray[Any, Any]


def is_missing(column: Column) -> Bool[np.ndarray, "N"]:
    """Where a column has no value: NaN, None, and text without any character."""
    if column.dtype.kind in "biu":
        return np.zeros(len(column), dtype=np.bool_)
    if column.dtype.kind == "f":
        return np.isnan(column)
    if column.dtype.kind in "US":
        return np.char.strip(column) == ("" if column.dtype.kind == "U" else b"")
    blank = (value is None or value != value or (isinstance(value, str) and not value.strip()) for value in column)
    return np.fromiter(blank, np.bool_, len(column))


def has_text(column: Column) -> bool:
    """Whether any value of a column is text."""
    return column.dtype.kind in "US" or (column.dtype.kind == "O" and any(isinstance(value, str) for value in column))


def as_numbers(column: Column, name: str) -> Float64[np.ndarray, "N"]:
    """A column as float64; what is missing becomes NaN. Text that is a number counts as that number.

    Raises `ValueError` that names column and row for anything else.
    """
    if column.dtype.kind in "biuf":
        return column.astype(np.float64)
    numbers = np.full(len(column), np.nan)
    missing = is_missing(column)
    try:
        numbers[~missing] = column[~missing].astype(np.float64)
    except (TypeError, ValueError):
        row = next(row for row in np.flatnonzero(~missing) if not _is_number(column[row]))
        raise ValueError(f"column {name!r} must hold numbers; got {str(column[row])!r:.60} in row {row}") from None
    return numbers


def _is_number(value: Any) -> bool:
    try:
        np.asarray(value).astype(np.float64)
    except (TypeError, ValueError):
        return False
    return np.ndim(value) == 0


def as_indices(column: Column, sensor: Sensor) -> Float64[np.ndarray, "N"]:
    """A column of text as the index of each text in `sensor.values`; NaN where it is missing.

    Raises `ValueError` that names sensor, row and the valid texts.
    """
    missing = is_missing(column)
    present = column[~missing].astype(str)
    texts, inverse = np.unique(present, return_inverse=True)
    labels = sensor.labels
    unknown = [text for text in texts.tolist() if text not in labels]
    if unknown:
        row = int(np.flatnonzero(~missing)[present == unknown[0]][0])
        raise ValueError(unknown_text(sensor, unknown[0], row))
    places = np.full(len(column), np.nan)
    places[~missing] = np.array([labels[text] for text in texts.tolist()], dtype=np.float64)[inverse.ravel()]
    return places


def unknown_text(sensor: Sensor, text: str, row: int) -> str:
    """What an error says about a text that is none of the values of a sensor."""
    return f"sensor {sensor.name!r} reads the text {str(text)!r:.80} in row {row}; {sensor.describe()}"


def as_episodes(column: Column, name: str) -> Int64[np.ndarray, "N"]:
    """The number of the run of each row: whole numbers as they are, anything else in order of first appearance.

    Raises `ValueError` for a missing value.
    """
    missing = is_missing(column)
    if missing.any():
        raise ValueError(f"column {name!r} names the run of each row, but has no value in row {int(missing.argmax())}")
    if column.dtype.kind in "iuf" and (np.floor(column) == column).all() and (np.abs(column) < 2.0**63).all():
        return column.astype(np.int64)
    _, first, inverse = np.unique(column.astype(str), return_index=True, return_inverse=True)
    order = np.empty(len(first), dtype=np.int64)
    order[first.argsort()] = np.arange(len(first))
    return order[inverse.ravel()]


def require(name: str, names: Sequence[str]) -> None:
    """Raise `ValueError` that suggests a name and lists all of them, unless `name` is one of `names`."""
    if name in names:
        return
    near = difflib.get_close_matches(name, names, 1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    raise ValueError(f"there is no column {name!r}; {hint}the columns are {', '.join(names)}")
