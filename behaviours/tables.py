"""Convert tables of numbers to tensors: tensors, arrays, lists, and data frames with column names."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Real
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

ReadText = Callable[[np.ndarray[Any, Any]], np.ndarray[Any, Any]]
"""Replaces text by numbers in a table of objects."""


def to_float64(values: Any, what: str, read_text: ReadText | None = None) -> Float64[Tensor, "..."]:
    """`values` as a float64 tensor; a float64 tensor is returned as it is, anything else is copied.

    Accepts what NumPy accepts, and objects with `to_numpy`, such as a DataFrame. Booleans count as 0 and 1. Tables with
    text, or of objects, are first passed through `read_text`. Raises `ValueError`, which begins with `what`, for
    complex numbers, other text, None, and rows of unequal length.
    """
    if isinstance(values, Tensor):
        if values.is_complex():
            raise ValueError(f"{what} must be real numbers; got {_dtype(values)}")
        return values.to(torch.float64)
    array = _array(values, what, read_text)
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{what} must be real numbers; got {_described(array)}")
    return torch.from_numpy(np.array(array, dtype=np.float64, order="C"))


def to_int64(values: Any, what: str) -> Int64[Tensor, "..."]:
    """A copy of `values` as int64. Raises `ValueError`, which begins with `what`, for anything but whole numbers."""
    if isinstance(values, Tensor):
        rows = values.detach().to(torch.float64) if values.is_floating_point() else values.detach()
        given = rows.cpu().numpy()
    else:
        given = _array(values, what)
    if given.dtype.kind not in "iuf":
        raise ValueError(f"{what} must be whole numbers; got {_described(given)}")
    if given.dtype.kind != "i":
        # This is true for NaN and infinity too; 2^63 is the smallest number above int64.
        wrong = ~((np.floor(given) == given) & (given >= -(2.0**63)) & (given < 2.0**63))
        if wrong.any():
            raise ValueError(f"{what} must be whole numbers; got {given[wrong].flat[0]} in row {int(wrong.argmax())}")
    whole = torch.from_numpy(np.array(given, dtype=np.int64, order="C"))
    return whole.to(values.device) if isinstance(values, Tensor) else whole


def to_mask(values: Any, rows: int, what: str) -> Tensor:
    """`values` as booleans `[rows]`. Raises `ValueError`, which begins with `what`, for indices and other lengths."""
    given = values if isinstance(values, Tensor) else _array(values, what)
    if given.dtype not in (torch.bool, np.bool_):
        raise ValueError(f"{what} must be one boolean per row, not indices or numbers; got {given.dtype}")
    if given.shape != (rows,):
        raise ValueError(f"{what} must be one boolean per row, [{rows}]; got shape {tuple(given.shape)}")
    return given if isinstance(given, Tensor) else torch.from_numpy(np.array(given))


def column_names(values: Any) -> tuple[str, ...] | None:
    """The column names of a data frame or series; None if there are none, or if all of them are numbers.

    Raises `ValueError` if some names are strings and others are not.
    """
    if isinstance(values, Tensor | np.ndarray | list | tuple) or not hasattr(values, "to_numpy"):
        return None
    names = list(values.columns) if hasattr(values, "columns") else [getattr(values, "name", None)]
    return checked_names(names, "columns") if any(isinstance(name, str) for name in names) else None


def columns_of(data: Any) -> dict[str, np.ndarray[Any, Any]]:
    """The columns `[N]` of a data frame, a table, or a mapping from names to columns, by name and in order.

    Raises `ValueError` for anything else, for names that are not different strings, and for columns of unequal length.
    """
    # A table of pyarrow has its names in `column_names`, a data frame in `columns`, and a mapping as its keys.
    names = getattr(data, "column_names", getattr(data, "columns", data if isinstance(data, Mapping) else None))
    if names is None or not hasattr(data, "__getitem__"):
        raise ValueError(
            "expected data with named columns: a data frame, a table, or a mapping from names to columns; "
            f"got {type(data).__name__}"
        )
    columns = {name: _column(data[name], name) for name in checked_names(list(names), "the columns of the data")}
    if not columns:
        raise ValueError("the data have no columns")
    if len({len(column) for column in columns.values()}) > 1:
        lengths = ", ".join(f"{name} {len(column)}" for name, column in columns.items())
        raise ValueError(f"the columns of the data differ in length: {lengths}")
    return columns


def _column(values: Any, name: str) -> np.ndarray[Any, Any]:
    if isinstance(values, Tensor):
        values = values.detach().cpu().numpy()
    array = np.asarray(_frame_values(values) if hasattr(values, "to_numpy") else values)
    if array.ndim != 1:
        raise ValueError(f"column {name!r} must have one value per row; got shape {array.shape}")
    return array


def checked_names(names: Any, what: str) -> tuple[str, ...]:
    """`names` as a tuple of distinct strings. Raises `ValueError`, which begins with `what`, for anything else."""
    if isinstance(names, str) or not isinstance(names, Sequence | np.ndarray):
        raise ValueError(f"{what}: expected the names of the columns, a sequence of strings; got {names!r}")
    if not all(isinstance(name, str) for name in names):
        raise ValueError(f"{what}: the names of columns must all be strings; got {list(names)}")
    if len(set(names)) < len(names):
        raise ValueError(f"{what}: the names of columns must differ; got {', '.join(names)}")
    return tuple(str(name) for name in names)


def compare_names(given: Sequence[str], expected: Sequence[str], what: str, whose: str = "the schema") -> None:
    """Raise `ValueError`, naming the columns, unless `given` are the `expected` names in the same order."""
    if tuple(given) == tuple(expected):
        return
    missing = [name for name in expected if name not in given]
    unknown = [name for name in given if name not in expected]
    problems = [f"missing: {', '.join(missing)}"] * bool(missing) + [f"unknown: {', '.join(unknown)}"] * bool(unknown)
    raise ValueError(
        f"the columns of the {what} are not those of {whose}; {'; '.join(problems) or 'their order differs'}; "
        f"expected {', '.join(expected)}; got {', '.join(given)}"
    )


def _array(values: Any, what: str, read_text: ReadText | None = None) -> np.ndarray[Any, Any]:
    """`values` as a NumPy array; objects that are all numbers become floats."""
    with _readable(what):
        if isinstance(values, np.ndarray):
            array = values
        elif hasattr(values, "to_numpy"):
            array = _frame_values(values)
        else:
            array = np.array(values)
    if read_text is not None and array.dtype.kind in "OU":
        with _readable(what):
            # NumPy would convert the numbers of lists with text to text, unless the type is object.
            array = array if isinstance(values, np.ndarray) or array.dtype == object else np.array(values, dtype=object)
            array = np.ma.filled(array.astype(object), np.nan)
        array = read_text(array)
    with _readable(what):
        return _plain(array, what)


@contextmanager
def _readable(what: str) -> Iterator[None]:
    """Convert errors of NumPy to a `ValueError` that begins with `what`."""
    try:
        yield
    except (TypeError, OverflowError, RuntimeError) as error:
        raise ValueError(f"{what} cannot be read as numbers: {error}") from error
    except ValueError as error:
        # Either NumPy's message for rows of unequal length, or one raised in this module.
        raise ValueError(str(error) if what in str(error) else f"{what} cannot be read as numbers: {error}") from error


def _frame_values(values: Any) -> np.ndarray[Any, Any]:
    try:
        # Missing values of pandas types become NaN.
        return np.asarray(values.to_numpy(na_value=np.nan))
    except TypeError:
        return np.asarray(values.to_numpy())


def _plain(array: np.ndarray[Any, Any], what: str) -> np.ndarray[Any, Any]:
    """Replace masked values by NaN, and convert objects to floats; raises `ValueError` unless all are real numbers."""
    if isinstance(array, np.ma.MaskedArray):
        array = np.ma.filled(array.astype(np.float64), np.nan)
    if array.dtype.kind != "O":
        return array
    for index, value in np.ndenumerate(array):
        if not isinstance(value, Real | np.bool_):
            row = f" in row {index[0]}" if index else ""
            raise ValueError(f"{what} must be real numbers (NaN for 'not observed'); got {value!r}{row}")
    return array.astype(np.float64)


def _dtype(values: Tensor) -> str:
    return str(values.dtype).removeprefix("torch.")


def _described(array: np.ndarray[Any, Any]) -> str:
    return f"text, such as {str(array.flat[0])!r}" if array.dtype.kind in "US" and array.size else str(array.dtype)
