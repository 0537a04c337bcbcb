"""CSV files."""

from csv import reader
from pathlib import Path
from typing import Any

import numpy as np

from behaviours.columns import Column
from behaviours.data.log import Log, name_and_unit, needed, texts_of

_MOSTLY = 0.9
"""A column is one of numbers if this share of its fields are; the others are then mistakes."""


def read_csv(path: str | Path) -> Log:
    """Read a CSV file whose first line names the columns; `front [m]` is the column `front` in metres.

    Fields are separated by commas, semicolons or tabs, as in the first line. Empty fields, and nan, na and null, are
    not observed. Needs pyarrow. Raises `ValueError` in one line for an empty file, for names that are not different,
    for rows of another length, and, naming the line, for text in a column of numbers.
    """
    csv: Any = needed("pyarrow.csv", "a CSV file", "pyarrow")
    path = Path(path)
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        first = file.readline()
    if not first.strip():
        raise ValueError(f"{path} is empty" if path.stat().st_size == 0 else f"{path}: the first line names no columns")
    delimiter = max(",;\t", key=first.count)
    titles = next(reader([first], delimiter=delimiter))
    names, units = zip(*map(name_and_unit, titles), strict=True)
    for name in names:
        if not name or names.count(name) > 1:
            raise ValueError(f"{path}: each column needs a name of its own; the first line has {first.strip()}")
    # Every field is read as text: types that are inferred from the first rows fail later, without the line's number.
    table: Any = _table(csv, path, delimiter, titles)
    if table.num_rows == 0:
        raise ValueError(f"{path} has no rows below its first line, {', '.join(titles)}")
    values = {name: _read(table.column(place), name, path) for place, name in enumerate(names)}
    return Log(values, {name: unit for name, unit in zip(names, units, strict=True) if unit})


def _table(csv: Any, path: Path, delimiter: str, titles: list[str]) -> Any:
    pyarrow: Any = needed("pyarrow", "a CSV file")
    convert = csv.ConvertOptions(
        column_types=dict.fromkeys(titles, pyarrow.string()),
        null_values=["", "nan", "NaN", "NAN", "na", "NA", "null", "NULL", "None"],
        strings_can_be_null=True,
    )
    try:
        return csv.read_csv(path, csv.ReadOptions(use_threads=False), csv.ParseOptions(delimiter=delimiter), convert)
    except pyarrow.ArrowInvalid as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from None


def _read(column: Any, name: str, path: Path) -> Column:
    """A column of texts as numbers if they are numbers, else as objects."""
    pyarrow: Any = needed("pyarrow", "a CSV file")
    compute: Any = needed("pyarrow.compute", "a CSV file", "pyarrow")
    column = compute.utf8_trim_whitespace(column.combine_chunks())
    try:
        return column.cast("float64").to_numpy(zero_copy_only=False)
    except pyarrow.ArrowInvalid:
        pass
    lower = compute.utf8_lower(column)
    if compute.all(compute.is_in(lower, pyarrow.array(["true", "false"])).filter(column.is_valid())).as_py():
        truth = compute.equal(lower, "true").cast("int8").cast("float64")
        return truth.to_numpy(zero_copy_only=False)
    number = compute.match_substring_regex(column, r"^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?$")
    share = compute.mean(number.cast("float64")).as_py()
    if share is not None and share > _MOSTLY:
        row = int(np.flatnonzero(~number.fill_null(True).to_numpy(zero_copy_only=False))[0])
        raise ValueError(f"{path}: column {name!r} holds numbers, but {column[row].as_py()!r:.60} in line {row + 2}")
    return texts_of(column)
