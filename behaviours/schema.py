"""What a robot senses and does: names, ranges, kinds and units."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from behaviours.kinds import allowed, placed, settled
from behaviours.parts import Actuator, Sensor, most_parts
from behaviours.tables import ReadText, column_names, compare_names, numbers
from torchvsa import ShapeError


@dataclass(frozen=True)
class Schema:
    """The sensors and actuators of a robot, in the order of the columns of its data.

    Readings and commands are rows of numbers: tensors, arrays, lists, or a DataFrame, whose names of columns must be
    those of the schema in the same order. Readings of categorical sensors may be text, see `Sensor`.
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
        """Plain values, for a file; the kinds and values of sensors only where they differ from the default."""
        data = asdict(self)
        for sensor in data["sensors"]:
            if sensor["kind"] == "real":
                del sensor["kind"]
            if not sensor["values"]:
                del sensor["values"]
        return data

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> "Schema":
        """The inverse of `to_dict`."""
        return cls([Sensor(**s) for s in data["sensors"]], [Actuator(**a) for a in data["actuators"]])

    def normalise(self, readings: Any) -> Float64[Tensor, "batch n"]:
        """Readings as numbers in [0, 1], which encoders take; NaN (not observed) stays NaN.

        A real reading is in units of its range, an angle a share of a full turn in [0, 1), a binary reading 0 or 1. The
        i-th of c categories is (i + 0.5) / c, the middle of the i-th of c bins, so that an encoder with c bins has
        exactly one for each.

        Raises an error that names sensor, row and what is allowed for anything else. In a compiled or exported graph no
        value can raise: there all readings, infinite ones too, are clipped, categories are the nearest one, and an
        infinite angle is one that was not observed.
        """
        rows, low, high = self._checked(readings)
        return (rows - low) / (high - low) if self._all_real else placed(self.sensors, rows)

    def check_bins(self, bins: int) -> None:
        """Raise `ValueError` for a sensor whose range cannot be parted into so many bins of equal width."""
        for sensor in self.sensors:
            if not sensor.choices and bins > most_parts(sensor.low, sensor.high):
                raise ValueError(
                    f"sensor {sensor.name!r}: {bins} bins of the range [{sensor.low}, {sensor.high}] cannot be told "
                    "apart in float64; take fewer, or a range of another width or nearer to 0"
                )

    def numeric(self, readings: Any) -> Float64[Tensor, "batch n"]:
        """Readings as float64 rows, with the indices of text; raises for unknown text, but looks at no numbers."""
        names = [sensor.name for sensor in self.sensors]
        labels = any(sensor.labels for sensor in self.sensors)
        return _rows(readings, len(names), "sensor readings", names, self._without_text if labels else None)

    def check_readings(self, readings: Any) -> Float64[Tensor, "batch n"]:
        """Readings as float64 rows, clipped where a sensor says so, angles within their range; raises if any is wrong.

        Text becomes its index, see `numeric`.
        """
        return self._checked(readings)[0]

    def _checked(self, readings: Any) -> tuple[Tensor, Tensor, Tensor]:
        """See `check_readings`; the least and the greatest value of each sensor too."""
        rows = self.numeric(readings)
        low, high = self._bounds(self.sensors, rows.device)
        if not torch.compiler.is_compiling():
            inside = (rows >= low) & (rows <= high)
            valid = inside if self._all_real else allowed(self.sensors, rows, inside)
            if (inside & valid).all():
                return rows, low, high
            self._refuse(rows, ~valid & ~rows.isnan())
        if self._all_real:
            return torch.minimum(torch.maximum(rows, low), high), low, high
        return settled(self.sensors, rows, low, high), low, high

    @property
    def _all_real(self) -> bool:
        return all(sensor.kind == "real" for sensor in self.sensors)

    def _refuse(self, rows: Tensor, wrong: Tensor) -> None:
        """Raise if a reading is infinite, or `wrong` and its sensor does not clip."""
        strict = torch.tensor([s.out_of_range == "error" for s in self.sensors], device=rows.device)
        wrong = rows.isinf() | (wrong & strict)
        if wrong.any():
            row, column = wrong.nonzero()[0].tolist()
            sensor = self.sensors[column]
            value = rows[row, column].item()
            clips = sensor.kind == "real" and not np.isinf(value)
            raise ValueError(
                f"sensor {sensor.name!r} reads {value:g} in row {row}; {sensor.described()}"
                + (" (declare it with out_of_range='clip' to accept the nearest bound)" if clips else "")
            )

    def _without_text(self, table: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """A copy of a table of objects in which the text of categorical sensors is its index."""
        names = [sensor.name for sensor in self.sensors]
        _check_shape(table.shape, len(names), "sensor readings", names)
        table = table.copy()
        for column, sensor in zip(table.T, self.sensors, strict=True):
            labels = sensor.labels
            for row, value in enumerate(column):
                if not isinstance(value, str):
                    continue
                if value not in labels:
                    raise ValueError(
                        f"sensor {sensor.name!r} reads the text {str(value)!r:.80} in row {row}; {sensor.described()}"
                        + ("" if labels else " (rows of numbers and text are lists, arrays of objects or data frames)")
                    )
                column[row] = labels[value]
        return table

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


def _rows(
    values: Any, columns: int, what: str, names: list[str], read_text: ReadText | None = None
) -> Float64[Tensor, "batch columns"]:
    given = column_names(values)
    if read_text is not None and given is not None and len(given) == columns:
        # Before text is looked for in columns that may be other ones.
        compare_names(given, names, what)
    rows = numbers(values, what, read_text)
    _check_shape(rows.shape, columns, what, names)
    if given is not None:
        compare_names(given, names, what)
    return rows


def _check_shape(shape: Sequence[int], columns: int, what: str, names: list[str]) -> None:
    if len(shape) != 2 or shape[1] != columns:
        hint = "; write one row as a batch of one, [row]" if tuple(shape) == (columns,) else ""
        raise ShapeError(
            f"{what} must be rows of {columns} values ({', '.join(names)}), shape [batch, {columns}]; "
            f"got shape {tuple(shape)}{hint}"
        )
