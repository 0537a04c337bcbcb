"""What a robot recorded, as named columns."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
from jaxtyping import Int64

from behaviours.columns import Column


@dataclass(frozen=True)
class Log:
    """Recorded columns of equal length, by name, as `Schema.from_data` and `Demonstrations.from_data` take them.

    Attributes:
        values: The columns `[N]`: numbers, or objects of which some are text.
        units: The units of the columns that have one.
        ranges: The smallest and the largest value of the columns for which the source knows them.
        episodes: The number of the run of each row `[N]`; None if the source does not tell runs apart.
        sensors: The columns of readings, if the source knows them.
        actuators: The columns of commands, if the source knows them.
        left_out: What was not read, and why.
        rate: The number of rows per second, if the source knows it.
    """

    values: Mapping[str, Column]
    units: Mapping[str, str] = field(default_factory=dict)
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    episodes: Int64[np.ndarray, "N"] | None = None
    sensors: Sequence[str] | None = None
    actuators: Sequence[str] | None = None
    left_out: Mapping[str, str] = field(default_factory=dict)
    rate: float | None = None

    @property
    def columns(self) -> list[str]:
        """The names of the columns."""
        return list(self.values)

    def __getitem__(self, name: str) -> Column:
        return self.values[name]

    def __len__(self) -> int:
        return len(next(iter(self.values.values()), ()))

    def __repr__(self) -> str:
        runs = "" if self.episodes is None else f", {len(np.unique(self.episodes))} episodes"
        return f"Log({len(self)} rows, {', '.join(self.columns)}{runs})"


def name_and_unit(title: str) -> tuple[str, str]:
    """The name and the unit of a column with a title such as `front [m]`; the unit is "" without brackets."""
    found = re.fullmatch(r"\s*(.*\S)\s*\[([^\[\]]*)\]\s*", title)
    return (found[1], found[2].strip()) if found else (title.strip(), "")


def needed(module: str, what: str, package: str = "") -> ModuleType:
    """Import a module of the extra `data`. Raises `ImportError` that names the package to install."""
    import importlib

    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != module.partition(".")[0]:
            raise
        name = package or module.partition(".")[0]
        raise ImportError(f"{what} needs {name}: pip install 'torchvsa[data]'", name=name) from error


def array_of(column: Any) -> Column:
    """A column of pyarrow as an array: numbers as numbers, with NaN for null, and anything else as objects."""
    types = needed("pyarrow", "this file").types
    if types.is_integer(column.type) or types.is_floating(column.type) or types.is_boolean(column.type):
        if column.null_count or types.is_floating(column.type):
            return column.cast("float64").to_numpy()
        return column.to_numpy()
    return texts_of(column.cast("string").combine_chunks())


def texts_of(column: Any) -> Column:
    """A column of text of pyarrow as objects, with None for null; equal texts share one object."""
    encoded = column.dictionary_encode()
    texts = np.array([*encoded.dictionary.to_pylist(), None], dtype=object)
    return texts[encoded.indices.fill_null(-1).to_numpy(zero_copy_only=False)]
