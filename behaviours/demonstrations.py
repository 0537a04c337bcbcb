"""Demonstrations: recorded readings, and the commands that answered them."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from behaviours.columns import as_episodes, as_indices, as_numbers, has_text, require
from behaviours.schema import Schema
from behaviours.storage import load_tensors, save_tensors
from behaviours.tables import (
    ReadText,
    checked_names,
    column_names,
    columns_of,
    compare_names,
    to_float64,
    to_int64,
    to_mask,
)
from torchvsa import ShapeError


class Demonstrations:
    """Pairs of sensor readings `[N, n]` and motor commands `[N, m]`, in the order in which they were shown.

    Args:
        sensors: The readings, as a tensor, array, list or data frame (a series is one column), which is copied. NaN
            means not observed.
        commands: The commands, likewise.
        episodes: The number of the run of each row, `[N]`; by default all rows are of run 0.
        sensor_names: The names of the columns of `sensors`; by default those of the data frame, if it is one. Learning
            compares them with the schema.
        actuator_names: The names of the columns of `commands`, likewise.
        units: The units of named columns, such as `{"front": "m"}`. Learning compares them with the schema.
        schema: With a schema, readings of categorical sensors may be text, which is stored as its index (see
            `Schema.numeric`), and all values are checked immediately; without one, learning checks them.

    Raises:
        ValueError: For no rows, unequal numbers of rows, infinite readings, infinite or NaN commands, episodes that are
            not whole numbers, and values that are not real numbers.
    """

    def __init__(
        self,
        sensors: Any,
        commands: Any,
        episodes: Any = None,
        *,
        sensor_names: Sequence[str] | None = None,
        actuator_names: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
        schema: Schema | None = None,
    ) -> None:
        given = sensors
        if schema is not None:
            # A series is one column.
            single = getattr(sensors, "ndim", None) == 1 and hasattr(sensors, "to_frame")
            given = schema.numeric(sensors.to_frame() if single else sensors)
        self.sensors: Float64[Tensor, "N n"] = _table(given, "sensors", _refuse_text)
        self.commands: Float64[Tensor, "N m"] = _table(commands, "commands")
        count = len(self.sensors)
        if count == 0:
            raise ValueError("a demonstration needs at least one row; this one is empty")
        if episodes is None:
            episodes = torch.zeros(count)
        self.episodes: Int64[Tensor, "N"] = to_int64(episodes, "episodes").clone()
        if self.episodes.dim() != 1:
            raise ShapeError(f"episodes must be one number per row, [N]; got shape {tuple(self.episodes.shape)}")
        for name, rows in (("commands", self.commands), ("episodes", self.episodes)):
            if len(rows) != count:
                raise ShapeError(f"{name} has {len(rows)} rows, but sensors has {count}; each row is one moment")
        if self.sensors.isinf().any():
            row, column = self.sensors.isinf().nonzero()[0].tolist()
            raise ValueError(f"sensors has an infinite value in row {row}, column {column}; use NaN for 'not observed'")
        if not self.commands.isfinite().all():
            row, column = (~self.commands.isfinite()).nonzero()[0].tolist()
            raise ValueError(f"commands has {self.commands[row, column].item()} in row {row}, column {column}")
        self.sensor_names = _names(sensors, self.sensors, sensor_names, "sensor_names")
        self.actuator_names = _names(commands, self.commands, actuator_names, "actuator_names")
        self.units = _checked_units(units, (*(self.sensor_names or ()), *(self.actuator_names or ())))
        if schema is not None:
            self.check(schema)

    @classmethod
    def from_data(cls, data: Any, schema: Schema, by: str | None = None) -> "Demonstrations":
        """The columns of `schema` in recorded data, by their names and in any order.

            shown = Demonstrations.from_data(frame, schema, by="run")

        Args:
            data: Anything with named columns, see `Schema.from_data`; other columns are ignored. Units that the data
                know (`data.units`) must be those of the schema.
            schema: The sensors and actuators.
            by: The column that names the run of each row, with numbers or text; by default `data.episodes`, or one run.

        Raises:
            ValueError: Naming the column, for one that is missing, and for values that the schema does not allow.
        """
        columns = columns_of(data)
        for name in (*(part.name for part in (*schema.sensors, *schema.actuators)), *([] if by is None else [by])):
            require(name, list(columns))
        readings = []
        for sensor in schema.sensors:
            column = columns[sensor.name]
            text = bool(sensor.labels) and has_text(column)
            readings.append(as_indices(column, sensor) if text else as_numbers(column, sensor.name))
        commands = [as_numbers(columns[actuator.name], actuator.name) for actuator in schema.actuators]
        units = getattr(data, "units", {})
        known = {part.name: units.get(part.name) or part.unit for part in (*schema.sensors, *schema.actuators)}
        return cls(
            np.stack(readings, 1),
            np.stack(commands, 1),
            getattr(data, "episodes", None) if by is None else as_episodes(columns[by], by),
            sensor_names=[sensor.name for sensor in schema.sensors],
            actuator_names=[actuator.name for actuator in schema.actuators],
            units={name: unit for name, unit in known.items() if unit},
            schema=schema,
        )

    def __len__(self) -> int:
        return len(self.sensors)

    def __repr__(self) -> str:
        return (
            f"Demonstrations({len(self)} rows, {self.sensors.shape[1]} sensors, {self.commands.shape[1]} actuators, "
            f"{len(self.episodes.unique())} episodes)"
        )

    def check(self, schema: Schema) -> None:
        """Raise `ValueError` unless the columns are those of `schema` and every value is in range."""
        self.check_names(schema)
        schema.check_readings(self.sensors)
        schema.command_levels(self.commands)

    def check_names(self, schema: Schema) -> None:
        """Raise `ValueError` if names of columns, their order, or units differ from those of `schema`."""
        schema.check_names(self.sensor_names, self.actuator_names)
        for part in (*schema.sensors, *schema.actuators):
            unit = self.units.get(part.name, part.unit)
            if part.unit and unit != part.unit:
                raise ValueError(
                    f"{part.name!r} is in {unit} in these demonstrations, and in {part.unit} in the schema"
                )

    def where(self, keep: Any) -> "Demonstrations":
        """The rows for which `keep` `[N]`, one boolean per row, is true. Raises `ValueError` for anything else."""
        # Readings and episodes may be on different devices; an index on the CPU works for both.
        chosen = to_mask(keep, len(self), "keep").cpu()
        rows = self.sensors[chosen], self.commands[chosen], self.episodes[chosen]
        return Demonstrations(
            *rows, sensor_names=self.sensor_names, actuator_names=self.actuator_names, units=self.units
        )

    @staticmethod
    def join(parts: Iterable["Demonstrations"]) -> "Demonstrations":
        """Concatenate demonstrations; episode numbers are kept.

        Raises `ValueError` for no demonstrations, and for different columns or names of columns.
        """
        parts = list(parts)
        if not parts:
            raise ValueError("there are no demonstrations to join")
        first = parts[0]
        for number, part in enumerate(parts):
            for field in ("sensors", "commands"):
                columns, expected = getattr(part, field).shape[1], getattr(first, field).shape[1]
                if columns != expected:
                    raise ShapeError(f"{field} of part {number} has {columns} columns, those of part 0 {expected}")
            if part.units != first.units:
                raise ValueError(f"part {number} has the units {part.units}, part 0 {first.units}")
            if part._names() != first._names():
                raise ValueError(
                    f"part {number} has columns with the names {part._names()}, part 0 {first._names()}; "
                    "joined parts have the same names in the same order, or none"
                )
        joined = (torch.cat([getattr(part, field) for part in parts]) for field in ("sensors", "commands", "episodes"))
        return Demonstrations(
            *joined, sensor_names=first.sensor_names, actuator_names=first.actuator_names, units=first.units
        )

    def save(self, path: str | Path) -> Path:
        """Write to one safetensors file, completely or not at all."""
        tensors = {"sensors": self.sensors, "commands": self.commands, "episodes": self.episodes}
        names = {key: list(value) for key, value in self._names().items() if value is not None}
        about = {"rows": len(self), **names} | ({"units": self.units} if self.units else {})
        return save_tensors(path, "demonstrations", tensors, about)

    @classmethod
    def load(cls, path: str | Path) -> "Demonstrations":
        """Read a file that `save` wrote. Raises `ValueError`, naming the file, for anything else."""
        tensors, about = load_tensors(path, "demonstrations")
        try:
            _check_file(tensors, about)
            names = {key: about.get(key) for key in _NAMES}
            units = about.get("units")
            return cls(tensors["sensors"], tensors["commands"], tensors["episodes"], **names, units=units)
        except (ValueError, RecursionError) as error:
            raise ValueError(f"{path} does not hold demonstrations of this version: {error}") from error

    def _names(self) -> dict[str, tuple[str, ...] | None]:
        return {"sensor_names": self.sensor_names, "actuator_names": self.actuator_names}


_TYPES = {"sensors": torch.float64, "commands": torch.float64, "episodes": torch.int64}
_NAMES = ("sensor_names", "actuator_names")


def _refuse_text(table: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    for index, value in np.ndenumerate(table):
        if isinstance(value, str):
            row = f" in row {index[0]}" if index else ""
            raise ValueError(
                f"sensors must be real numbers; got the text {str(value)!r:.80}{row} (give schema= to read the "
                "text of categorical sensors)"
            )
    return table


def _table(values: Any, name: str, read_text: ReadText | None = None) -> Float64[Tensor, "N columns"]:
    """A copy of a table as a tensor; a series becomes one column."""
    rows = to_float64(values, name, read_text).detach()
    if rows.dim() == 1 and hasattr(values, "to_numpy"):
        rows = rows[:, None]
    if rows.dim() != 2 or rows.shape[1] == 0:
        hint = "; write one row as [row]" if rows.dim() == 1 and len(rows) else ""
        raise ShapeError(f"{name} must be rows of values, [N, columns]; got shape {tuple(rows.shape)}{hint}")
    return rows.clone(memory_format=torch.contiguous_format)


def _names(values: Any, rows: Tensor, given: Sequence[str] | None, what: str) -> tuple[str, ...] | None:
    """The names of the columns: those `given`, which must equal those of a data frame."""
    found = column_names(values)
    if given is None:
        return found
    names = checked_names(given, what)
    if len(names) != rows.shape[1]:
        raise ValueError(f"{what} has {len(names)} names for {rows.shape[1]} columns")
    if found is not None:
        compare_names(found, names, "data frame", what)
    return names


def _checked_units(units: Any, names: Sequence[str]) -> dict[str, str]:
    """A copy of the units. Raises `ValueError` unless they map names of columns to texts."""
    if units is None:
        return {}
    if not isinstance(units, Mapping) or not all(isinstance(unit, str) for unit in units.values()):
        raise ValueError(f"units map names of columns to texts, such as {{'front': 'm'}}; got {units!r:.200}")
    if unknown := [name for name in units if name not in names]:
        raise ValueError(f"units has {unknown[0]!r}, which is no named column; there are {', '.join(names) or 'none'}")
    return dict(units)


def _check_file(tensors: dict[str, Tensor], about: Any) -> None:
    """Raise `ValueError`, naming the field, unless a file holds what `Demonstrations.save` writes."""
    if set(tensors) != set(_TYPES):
        raise ValueError(f"expected the tensors {', '.join(_TYPES)}; got {', '.join(sorted(tensors)) or 'none'}")
    for name, dtype in _TYPES.items():
        if tensors[name].dtype != dtype:
            raise ValueError(f"{name} must be of type {dtype}; got {tensors[name].dtype}")
    if not isinstance(about, dict) or not set(about) <= {"rows", "units", *_NAMES}:
        raise ValueError(f"its description must contain only rows, units, {', '.join(_NAMES)}; got {about!r:.200}")
    rows = about.get("rows", len(tensors["sensors"]) if tensors["sensors"].dim() else 0)
    if type(rows) is not int or tensors["sensors"].shape[:1] != (rows,):
        raise ValueError(f"rows is {rows!r:.200}, but sensors has shape {tuple(tensors['sensors'].shape)}")
    for name in _NAMES:
        if name in about and not isinstance(about[name], list):
            raise ValueError(f"{name} must be a list of strings; got {about[name]!r:.200}")
