"""What a robot senses and does: names, ranges and units."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from behaviours.parts import Actuator, Sensor, most_parts
from behaviours.tables import column_names, compare_names, numbers
from torchvsa import ShapeError


@dataclass(frozen=True)
class Schema:
    """The sensors and actuators of a robot, in the order of the columns of its data.

    Readings and commands are rows of numbers: tensors, arrays, lists, or a DataFrame, whose names of columns must be
    those of the schema in the same order.
    """

    sensors: Sequence[Sensor]
    actuators: Sequence[Actuator]

    def __post_init__(self) -> None:
        object.__setattr__(self, "sensors", tuple(self.sensors))
        object.__setattr__(self, "actuators", tuple(self.actuators))
        for kind, parts in (("sensor", self.sensors), ("actuator", self.actuators)):
            if not all(isinstance(part, Sensor if kind == "sensor" else Actuator) for part in parts):
                raise ValueError(f"the {kind}s of a schema must be of type {kind.capitalize()}; got {parts}")
            names = [part.name for part in parts]
            if not names:
                raise ValueError(f"a schema needs at least one {kind}")
            if len(set(names)) < len(names):
                raise ValueError(f"{kind} names must differ; got {', '.join(names)}")

    def check_names(self, sensors: Sequence[str] | None = None, actuators: Sequence[str] | None = None) -> None:
        """Raise `ValueError`, naming the columns, unless these are the schema's names in the same order.

        None stands for columns without names, which are not compared.
        """
        if sensors is not None:
            compare_names(sensors, [sensor.name for sensor in self.sensors], "sensor readings")
        if actuators is not None:
            compare_names(actuators, [actuator.name for actuator in self.actuators], "commands")

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for a file."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> "Schema":
        """The inverse of `to_dict`."""
        return cls([Sensor(**s) for s in data["sensors"]], [Actuator(**a) for a in data["actuators"]])

    def normalise(self, readings: Any) -> Float64[Tensor, "batch n"]:
        """Readings in units of their sensors' ranges, within [0, 1]; NaN (not observed) stays NaN.

        Raises an error that names sensor, row and range for infinite readings and those out of range. In a compiled or
        exported graph no value can raise: there all readings, infinite ones too, are clipped.
        """
        rows, low, high = self._checked(readings)
        return (rows - low) / (high - low)

    def check_bins(self, bins: int) -> None:
        """Raise `ValueError` for a sensor whose range cannot be parted into so many bins of equal width."""
        for sensor in self.sensors:
            if bins > most_parts(sensor.low, sensor.high):
                raise ValueError(
                    f"sensor {sensor.name!r}: {bins} bins of the range [{sensor.low}, {sensor.high}] cannot be told "
                    "apart in float64; take fewer, or a range of another width or nearer to 0"
                )

    def check_readings(self, readings: Any) -> Float64[Tensor, "batch n"]:
        """Readings as float64 rows, clipped where a sensor says so; raises if any is not valid.

        In a compiled or exported graph no value can raise: there all readings, infinite ones too, are clipped.
        """
        return self._checked(readings)[0]

    def _checked(self, readings: Any) -> tuple[Tensor, Tensor, Tensor]:
        """See `check_readings`; the least and the greatest value of each sensor too."""
        rows = _rows(readings, len(self.sensors), "sensor readings", [s.name for s in self.sensors])
        low, high = self._bounds(self.sensors, rows.device)
        if not torch.compiler.is_compiling():
            inside = (rows >= low) & (rows <= high)
            if inside.all():
                return rows, low, high
            self._refuse(rows, ~inside & ~rows.isnan())
        return torch.minimum(torch.maximum(rows, low), high), low, high

    def _refuse(self, rows: Tensor, outside: Tensor) -> None:
        """Raise if a reading is infinite, or `outside` a range and its sensor does not clip."""
        strict = torch.tensor([s.beyond == "error" for s in self.sensors], device=rows.device)
        wrong = rows.isinf() | (outside & strict)
        if wrong.any():
            row, column = wrong.nonzero()[0].tolist()
            sensor = self.sensors[column]
            value = rows[row, column].item()
            raise ValueError(
                f"sensor {sensor.name!r} reads {value:g} in row {row}; its range is [{sensor.low:g}, {sensor.high:g}]"
                f"{' ' + sensor.unit if sensor.unit else ''}"
                + ("" if np.isinf(value) else " (declare it with beyond='clip' to accept the nearest bound)")
            )

    def command_levels(self, commands: Any) -> Int64[Tensor, "batch m"]:
        """The nearest level of each command (halves up). Raises, naming actuator and row, if one is not in range."""
        rows = _rows(commands, len(self.actuators), "commands", [a.name for a in self.actuators])
        low, high = self._bounds(self.actuators, rows.device)
        wrong = ~((rows >= low) & (rows <= high))
        if wrong.any():
            row, column = wrong.nonzero()[0].tolist()
            actuator = self.actuators[column]
            raise ValueError(
                f"actuator {actuator.name!r} is told {rows[row, column].item():g} in row {row}; "
                f"its range is [{actuator.low:g}, {actuator.high:g}]{' ' + actuator.unit if actuator.unit else ''}"
            )
        steps = torch.tensor([a.levels - 1 for a in self.actuators], dtype=torch.float64, device=rows.device)
        return ((rows - low) / (high - low) * steps + 0.5).floor().to(torch.int64)

    def command_values(self, levels: Int64[Tensor, "batch m"]) -> Float64[Tensor, "batch m"]:
        """The command that each level stands for."""
        low, high = self._bounds(self.actuators, levels.device)
        steps = torch.tensor([a.levels - 1 for a in self.actuators], dtype=torch.float64, device=levels.device)
        return low + (high - low) * levels.to(torch.float64) / steps

    @staticmethod
    def _bounds(parts: Sequence[Sensor] | Sequence[Actuator], device: torch.device) -> tuple[Tensor, Tensor]:
        ranges = torch.tensor([(part.low, part.high) for part in parts], dtype=torch.float64, device=device)
        return ranges[:, 0], ranges[:, 1]


def _rows(values: Any, columns: int, what: str, names: list[str]) -> Float64[Tensor, "batch columns"]:
    rows = numbers(values, what)
    if rows.dim() != 2 or rows.shape[1] != columns:
        hint = "; write one row as a batch of one, [row]" if rows.dim() == 1 and len(rows) == columns else ""
        raise ShapeError(
            f"{what} must be rows of {columns} values ({', '.join(names)}), shape [batch, {columns}]; "
            f"got shape {tuple(rows.shape)}{hint}"
        )
    given = column_names(values)
    if given is not None:
        compare_names(given, names, what)
    return rows
