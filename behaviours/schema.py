"""What a robot senses and does: names, ranges and units."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from behaviours.parts import Actuator, Sensor, most_parts
from behaviours.tables import column_names, compare_names, numbers
from torchvsa import ShapeError
from torchvsa._memory_limit import require_memory


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

    @cached_property
    def _most_bins(self) -> float:
        """The most bins of equal width that every sensor without edges can be parted into."""
        even = (most_parts(sensor.low, sensor.high) for sensor in self.sensors if sensor.edges is None)
        return min(even, default=math.inf)

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

    def sensor_bins(self, readings: Any, bins: int) -> Int64[Tensor, "batch n"]:
        """The bin of each reading: `bins` of equal width over each sensor's range, -1 for NaN (not observed).

        Bin `b` holds `low + width · b <= reading < low + width · (b + 1)`; `high` itself lies in the last.
        Sensors with `edges` have their bins between them instead.
        Raises an error that names sensor, row and range for infinite readings and those out of range.
        """
        if not torch.compiler.is_compiling() and bins > self._most_bins:
            self._refuse_bins(bins)
        rows, low, high = self._checked(readings)
        unseen = rows.isnan()
        index = ((rows - low) * bins / (high - low)).floor().clamp(0, bins - 1)
        index = torch.where(unseen, -1.0, index).to(torch.int64)
        if all(sensor.edges is None for sensor in self.sensors):
            return index
        columns = zip(self.sensors, rows.unbind(1), index.unbind(1), strict=True)
        index = torch.stack([self._between_edges(s, bins, row, even) for s, row, even in columns], 1)
        return torch.where(unseen, -1, index)

    def _refuse_bins(self, bins: int) -> None:
        """Raise for the first sensor whose range cannot be parted into so many bins."""
        for sensor in self.sensors:
            if sensor.edges is None and bins > most_parts(sensor.low, sensor.high):
                raise ValueError(
                    f"sensor {sensor.name!r}: {bins} bins of the range [{sensor.low}, {sensor.high}] cannot be told "
                    "apart in float64; take fewer, or a range of another width or nearer to 0"
                )

    @staticmethod
    def _between_edges(sensor: Sensor, bins: int, readings: Tensor, even: Tensor) -> Int64[Tensor, "batch"]:
        """The bins of one sensor's readings between its edges, or those of `even` width where it has none."""
        if sensor.edges is None:
            return even
        if len(sensor.edges) >= bins:
            raise ValueError(
                f"sensor {sensor.name!r} has {len(sensor.edges)} edges, which part one bin more than that; "
                f"the encoder has {bins}"
            )
        edges = torch.tensor(sensor.edges, dtype=torch.float64, device=readings.device)
        if torch.compiler.is_exporting():
            # The same by comparisons: interchange formats have no bucket search.
            return (readings[:, None] >= edges).sum(1)
        return torch.bucketize(readings.contiguous(), edges, right=True)

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


def quantile_edges(readings: Any, bins: int) -> Float64[Tensor, "edges"]:
    """The edges `[bins - 1]` that part readings `[N]` into `bins` bins of nearly equal counts.

    An edge lies midway between two neighbouring readings; where readings repeat, edges coincide. NaN is left
    out; without any reading there are no edges. Sees no commands. Raises `ValueError` for infinite readings, and for
    fewer than one bin.
    """
    if bins < 1:
        raise ValueError(f"readings are parted into at least one bin; got {bins}")
    values = numbers(readings, "readings").flatten()
    if values.isinf().any():
        raise ValueError("readings must be finite, or NaN where there is none")
    values = values[~values.isnan()].sort().values
    if len(values) < 2:
        return values[:0]
    # Positions, the readings on both sides, and what lies between them.
    require_memory(6 * 8 * bins, f"the edges of {bins:,} bins", "take fewer bins")
    above = (torch.arange(1, bins) * len(values)).div(bins, rounding_mode="floor").clamp(min=1)
    low, high = values[above - 1], values[above]
    middle = low + (high - low) / 2
    # Neighbours of opposite signs may be further apart than the largest float.
    middle = torch.where(middle.isinf(), low / 2 + high / 2, middle)
    # The mean of two floats side by side may be the lower of them, and would not part them.
    return torch.where(middle > low, middle, high)


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
