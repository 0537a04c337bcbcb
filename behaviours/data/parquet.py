"""Parquet files."""

from pathlib import Path
from typing import Any

from behaviours.data.log import Log, array_of, name_and_unit, needed


def read_parquet(path: str | Path) -> Log:
    """Read a Parquet file; nulls are not observed. Units are in brackets of a name, or in its field's metadata `unit`.

    Columns that are neither numbers, booleans nor text are left out. Needs pyarrow. Raises `ValueError` for a file that
    cannot be read, for no rows, and for names that are not different.
    """
    parquet: Any = needed("pyarrow.parquet", "a Parquet file", "pyarrow")
    pyarrow: Any = needed("pyarrow", "a Parquet file")
    try:
        table = parquet.read_table(path)
    except pyarrow.ArrowInvalid as error:
        raise ValueError(f"{path} is no readable Parquet file: {' '.join(str(error).split())}") from None
    if table.num_rows == 0:
        raise ValueError(f"{path} has no rows, only the columns {', '.join(table.column_names)}")
    values, units, left_out = {}, {}, {}
    for field, column in zip(table.schema, table.columns, strict=True):
        name, unit = name_and_unit(field.name)
        if name in values or name in left_out:
            raise ValueError(f"{path}: two columns have the name {name!r}")
        if not _is_plain(pyarrow.types, field.type):
            left_out[name] = f"it holds {field.type}, not numbers or text"
            continue
        values[name] = array_of(column)
        if unit := unit or (field.metadata or {}).get(b"unit", b"").decode():
            units[name] = unit
    return Log(values, units, left_out=left_out)


def _is_plain(types: Any, kind: Any) -> bool:
    kind = kind.value_type if types.is_dictionary(kind) else kind
    checks = "is_integer", "is_floating", "is_boolean", "is_string", "is_large_string", "is_string_view", "is_null"
    return any(getattr(types, check)(kind) for check in checks)
