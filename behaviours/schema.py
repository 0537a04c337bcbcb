"""The sensors and actuators of a robot, and the validation of its data."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from behaviours.columns import unknown_text
from behaviours.env_spaces import propose_for
from behaviours.kinds import canonical, to_unit_interval, valid_readings
from behaviours.parts import Actuator, Sensor, most_parts
from behaviours.proposal import propose
from behaviours.tables import ReadText, column_names, compare_names, to_float64
from torchvsa import ShapeError


@dataclass(frozen=True)
class Schema:
    """The sensors and actuators of a robot, in the order of the columns of its data.

    Readings and commands are rows of numbers: tensors, arrays, lists, or a DataFrame whose column names are those of
    the schema, in the same order. Readings of categorical sensors may be text, see `Sensor`.
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

        Columns without names (None) are not compared.
        """
        if sensors is not None:
            compare_names(sensors, [sensor.name for sensor in self.sensors], "sensor readings")
        if actuators is not None:
            compare_names(actuators, [actuator.name for actuator in self.actuators], "commands")

    def to_dict(self) -> dict[str, Any]:
        """The schema as plain values, for a file; `kind` and `values` only if they differ from the default."""
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

    @classmethod
    def from_data(
        cls,
        data: Any,
        actuators: Sequence[str] | None = None,
        sensors: Sequence[str] | None = None,
        *,
        by: str | None = None,
        changes: Mapping[str, Mapping[str, Any] | None] | None = None,
        show: Callable[[str], object] | None = None,
    ) -> "Schema":
        """Propose the schema of recorded data: what each column is, and in which range.

            schema = Schema.from_data(frame, ["v", "omega"], by="run", show=print)

        | a column with | becomes |
        |---|---|
        | text of at most 32 different values | a categorical sensor |
        | only 0 and 1 | a binary sensor |
        | numbers that fill a turn, and the name of an angle (heading, yaw ...) | an angle |
        | other numbers | a real sensor that clips, with the range of all but outliers |
        | one value, none, much text; or numbers that grow from row to row in every run, unless named | nothing |

        Outliers are farther from the middle 98 % of the readings than half of their width. An actuator has the range of
        its commands; up to 64 evenly spaced commands are its levels.

        Args:
            data: Anything with named columns: a data frame, a table, a mapping, a `behaviours.data.Log`.
            actuators: The columns of commands; a `Log` may know them.
            sensors: The columns of readings, by default all others that can be sensors.
            by: The column that names the run of each row.
            changes: Corrections by column: arguments of `Sensor` or `Actuator`, such as `{"kind": "angle", "low": 0,
                "high": 360}`, or None to leave it out.
            show: Called with a line of text for each column: what it is taken for, or why it is left out.

        Raises:
            ValueError: Naming the column, for one that does not exist, text among numbers, infinite readings, commands
                that are missing or constant, data without rows, and wrong corrections.
        """
        found = propose(data, sensors, actuators, by, changes)
        if show is not None:
            for line in found.lines():
                show(line)
        return cls(found.sensors, found.actuators)

    @classmethod
    def from_env(cls, env: Any, data: Any = None, *, show: Callable[[str], object] | None = None) -> "Schema":
        """The schema of a Gymnasium environment: its observations are the sensors, its actions the actuators.

            shown = behaviours.data.collect(env, expert, episodes=5)
            schema = Schema.from_env(env, shown)

        | an element of | as a sensor | as an actuator |
        |---|---|---|
        | `Box` | real, with its bounds, and clips | with its bounds; a level for each of up to 64 whole numbers |
        | `Discrete`, `MultiDiscrete` | categorical; of 0 and 1, binary | a level for each value |
        | `MultiBinary` | binary | two levels |

        `Dict` and `Tuple` are flattened; names are those of `data`, or such as `observation[2]` and `action.arm`.
        Images and text are left out.

        Args:
            env: The environment.
            data: Recorded columns with these names, as of `collect`. Bounds that are infinite are learned from them, as
                the ranges of `from_data`.
            show: Called with a line of text for each element.

        Raises:
            ValueError: For infinite bounds without data, actions that are not numbers, and anything but an environment.
        """
        found = propose_for(env, data)
        if show is not None:
            for line in found.lines():
                show(line)
        return cls(found.sensors, found.actuators)

    def normalise(self, readings: Any) -> Float64[Tensor, "batch n"]:
        """Map readings to [0, 1], for encoders; NaN (not observed) stays NaN.

        A real reading becomes its position in the range, an angle its fraction of a full turn in [0, 1), a binary
        reading 0 or 1. Category i of c becomes (i + 0.5) / c, the middle of bin i of c, so that an encoder with c bins
        has exactly one bin per category.

        Raises `ValueError` that names sensor, row and the valid readings. A compiled or exported graph cannot raise:
        there, all readings, including infinite ones, are clipped, categories are rounded to the nearest one, and an
        infinite angle counts as not observed.
        """
        rows, low, high = self._checked(readings)
        return (rows - low) / (high - low) if self._all_real else to_unit_interval(self.sensors, rows)

    def check_bins(self, bins: int) -> None:
        """Raise `ValueError` for a sensor whose range float64 cannot divide into `bins` bins of equal width."""
        for sensor in self.sensors:
            if not sensor.choices and bins > most_parts(sensor.low, sensor.high):
                raise ValueError(
                    f"sensor {sensor.name!r}: {bins} bins of the range [{sensor.low}, {sensor.high}] cannot be told "
                    "apart in float64; take fewer bins, or a wider range, or one nearer to 0"
                )

    def numeric(self, readings: Any) -> Float64[Tensor, "batch n"]:
        """Readings as float64 rows, with text replaced by its index. Raises for unknown text; checks no numbers."""
        names = [sensor.name for sensor in self.sensors]
        labels = any(sensor.labels for sensor in self.sensors)
        return _rows(readings, len(names), "sensor readings", names, self._without_text if labels else None)

    def check_readings(self, readings: Any) -> Float64[Tensor, "batch n"]:
        """Valid readings as float64 rows: clipped for sensors that clip, angles wrapped, text replaced by its index.

        Raises `ValueError` that names sensor, row and the valid readings.
        """
        return self._checked(readings)[0]

    def _checked(self, readings: Any) -> tuple[Tensor, Tensor, Tensor]:
        """The rows of `check_readings`, and the bounds `low` and `high` of each sensor."""
        rows = self.numeric(readings)
        low, high = self._bounds(self.sensors, rows.device)
        if not torch.compiler.is_compiling():
            inside = (rows >= low) & (rows <= high)
            valid = inside if self._all_real else valid_readings(self.sensors, rows, inside)
            if (inside & valid).all():
                return rows, low, high
            self._refuse(rows, ~valid & ~rows.isnan())
        if self._all_real:
            return torch.minimum(torch.maximum(rows, low), high), low, high
        return canonical(self.sensors, rows, low, high), low, high

    @property
    def _all_real(self) -> bool:
        return all(sensor.kind == "real" for sensor in self.sensors)

    def _refuse(self, rows: Tensor, wrong: Tensor) -> None:
        """Raise `ValueError` if a reading is infinite, or `wrong` for a sensor that does not clip."""
        strict = torch.tensor([s.out_of_range == "error" for s in self.sensors], device=rows.device)
        wrong = rows.isinf() | (wrong & strict)
        if wrong.any():
            row, column = wrong.nonzero()[0].tolist()
            sensor = self.sensors[column]
            value = rows[row, column].item()
            clips = sensor.kind == "real" and not np.isinf(value)
            raise ValueError(
                f"sensor {sensor.name!r} reads {value:g} in row {row}; {sensor.describe()}"
                + (" (declare it with out_of_range='clip' to accept the nearest bound)" if clips else "")
            )

    def _without_text(self, table: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """A copy of a table of objects, with the text of categorical sensors replaced by its index."""
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
                        unknown_text(sensor, value, row)
                        + ("" if labels else " (rows of numbers and text are lists, arrays of objects or data frames)")
                    )
                column[row] = labels[value]
        return table

    def command_levels(self, commands: Any) -> Int64[Tensor, "batch m"]:
        """The nearest level of each command; halves are rounded up.

        Raises `ValueError`, naming actuator and row, for a command out of range.
        """
        rows = _rows(commands, len(self.actuators), "commands", [a.name for a in self.actuators])
        low, high = self._bounds(self.actuators, rows.device)
        wrong = ~((rows >= low) & (rows <= high))
        if wrong.any():
            row, column = wrong.nonzero()[0].tolist()
            actuator = self.actuators[column]
            raise ValueError(
                f"actuator {actuator.name!r} has the command {rows[row, column].item():g} in row {row}; "
                f"its range is [{actuator.low:g}, {actuator.high:g}]{' ' + actuator.unit if actuator.unit else ''}"
            )
        steps = torch.tensor([a.levels - 1 for a in self.actuators], dtype=torch.float64, device=rows.device)
        return ((rows - low) / (high - low) * steps + 0.5).floor().to(torch.int64)

    def command_values(self, levels: Int64[Tensor, "batch m"]) -> Float64[Tensor, "batch m"]:
        """The command of each level."""
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
        # Checked first, since wrong columns would give misleading errors about their text.
        compare_names(given, names, what)
    rows = to_float64(values, what, read_text)
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
