"""Why a controller gave its commands, and what would have changed them."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

from behaviours.controller import Controller
from behaviours.memory import require_levels
from behaviours.parts import Actuator, Sensor
from behaviours.recall import Recall
from behaviours.schema import Schema
from torchvsa.encoders import Encoder, Record, ThresholdFeatures

_GRID = 64
"""The number of values that are tried per sensor where an encoder has no bins."""


class Change(NamedTuple):
    """A change of one reading that would have changed the commands."""

    sensor: str
    value: float
    """The reading that would have changed them; of a sensor with text values, the index."""
    size: float
    """How far the reading would have to move, as a fraction of the sensor's range; 1 for another category."""
    commands: tuple[float, ...]
    """The commands that it would have given."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """Why a controller gave its commands, for each row of readings; `print` it, or one row, `explanation[i]`."""

    schema: Schema
    readings: Float64[Tensor, "batch n"]
    commands: Float64[Tensor, "batch m"]
    """NaN where no sensor was observed."""
    speaker: tuple[str, ...]
    """The name of the behaviour that answered, "" where it has none."""
    margin: Float[Tensor, "batch"]
    familiarity: Float[Tensor, "batch"]
    changed: Bool[Tensor, "batch n"]
    """Whether the commands would change if the sensor were not observed."""
    margin_drop: Float[Tensor, "batch n"]
    """How far the lead of the answer over its best rival would fall if the sensor were not observed.

    Negative where it would grow. Where the commands would change, the margin of the other answer is counted as negative
    lead: a lower bound.
    """
    nearest: tuple[Change | None, ...]
    """The smallest change of a single reading that would have changed the commands; None if there is none."""

    def __len__(self) -> int:
        return len(self.speaker)

    def __getitem__(self, row: int) -> "Explanation":
        at = range(len(self))[row]
        rows = slice(at, at + 1)
        fields = {name: value if name == "schema" else value[rows] for name, value in vars(self).items()}
        return Explanation(**fields)

    def __str__(self) -> str:
        return "\n\n".join(self._text(row) for row in range(len(self)))

    def _text(self, row: int) -> str:
        sensors, actuators = self.schema.sensors, self.schema.actuators
        read = _listed([_reading(*pair) for pair in zip(sensors, self.readings[row].tolist(), strict=True)])
        if self.commands[row].isnan().any():
            return "No sensor was observed, so that there is no command."
        commands = _commands(actuators, self.commands[row].tolist())
        speaker = f"{self.speaker[row]} answered with" if self.speaker[row] else "The answer has"
        return (
            f"{read}: {commands}.\n"
            f"  {speaker} a margin of {self.margin[row]:.2g} and a familiarity of {self.familiarity[row]:.2g}.\n"
            f"  {self._decisive(row)}\n"
            f"  {self._nearest(row)}"
        )

    def _decisive(self, row: int) -> str:
        names = [sensor.name for sensor in self.schema.sensors]
        decisive = [name for name, changed in zip(names, self.changed[row].tolist(), strict=True) if changed]
        if decisive:
            return f"The commands would change without {_listed(decisive, 'or')}."
        sensor = int(self.margin_drop[row].argmax())
        drop = float(self.margin_drop[row, sensor])
        most = f"; it needs {names[sensor]} most, without which the margin falls by {drop:.2g}" if drop > 0 else ""
        return f"The answer is the same without any one of the sensors{most}."

    def _nearest(self, row: int) -> str:
        change = self.nearest[row]
        if change is None:
            return "No change of a single reading would change it."
        sensor = next(sensor for sensor in self.schema.sensors if sensor.name == change.sensor)
        far = "" if sensor.choices else f" ({100 * change.size:.2g} % of its range away)"
        commands = _commands(self.schema.actuators, change.commands)
        return f"Nearest change: {_reading(sensor, change.value)}{far} would give {commands}."


@torch.no_grad()
def explain(controller: Controller, readings: Any) -> Explanation:
    """Explain the answers of a behaviour or policy to readings `[B, n]`.

    Each sensor is hidden in turn, and each is set to every other value that the encoder tells apart (the middles of its
    bins, or 64 values over its range if it has none) while the other readings stay. All of these rows are one batch:
    B · (1 + n + values of all sensors) rows.

    Args:
        controller: A behaviour, or a policy without a state.
        readings: What the sensors read.

    Raises:
        ValueError: For a controller whose answers depend on the past, for smooth commands, and for invalid readings.
    """
    space = controller.space
    require_levels("explain", controller.modules())
    if space.encoder.width != space.encoder.sensors or type(controller).start is not Controller.start:
        raise ValueError(
            f"{type(controller).__name__} answers by what it read before; only the answers of controllers without a "
            "state can be explained from one row of readings"
        )
    rows = space.schema.check_readings(readings)
    column, value = _candidates(space.schema, space.encoder)
    column, value = column.to(rows.device), value.to(rows.device)
    sensors = rows.shape[1]
    hidden = rows[:, None].repeat(1, sensors, 1)
    hidden.diagonal(dim1=1, dim2=2).fill_(torch.nan)
    moved = rows[:, None].repeat(1, len(column), 1)
    moved[:, torch.arange(len(column)), column] = value
    asked = torch.cat([rows[:, None], hidden, moved], 1)
    recall = controller(asked.flatten(0, 1))
    commands, margin = (answer.unflatten(0, asked.shape[:2]) for answer in (recall.commands, recall.margin))
    differs = _differ(commands[:, :1], commands[:, 1:])
    changed, moves = differs[:, :sensors], differs[:, sensors:]
    first = recall.rows(torch.arange(len(rows), device=margin.device) * asked.shape[1])
    return Explanation(
        space.schema, rows, first.commands, _speakers(controller, first), first.margin, first.familiarity, changed,
        _margin_drop(margin[:, :1], margin[:, 1 : 1 + sensors], changed),
        _nearest(space.schema, rows, column, value, moves, commands[:, 1 + sensors :]),
    )  # fmt: skip


def _candidates(schema: Schema, encoder: Encoder) -> tuple[Int64[Tensor, "c"], Float64[Tensor, "c"]]:
    """The columns and values of all readings to try."""
    values = [
        torch.tensor(sensor.choices, dtype=torch.float64)
        if sensor.choices
        else sensor.low + (sensor.high - sensor.low) * _positions(encoder, column)
        for column, sensor in enumerate(schema.sensors)
    ]
    columns = torch.arange(len(values)).repeat_interleave(torch.tensor([len(each) for each in values]))
    return columns, torch.cat(values)


def _positions(encoder: Encoder, column: int) -> Float64[Tensor, "c"]:
    """One position in [0, 1] of each bin of a sensor, or a grid."""
    if isinstance(encoder, ThresholdFeatures) and "edges" in encoder.own_layout():
        edges = encoder.edges[column].cpu()
        edges = edges[edges.isfinite()]
        if len(edges):
            bounds = torch.cat([edges.new_zeros(1), edges, edges.new_ones(1)]).unique()
            return (bounds[1:] + bounds[:-1]) / 2
    source: Any = encoder
    if isinstance(encoder, Record):
        source = encoder.values[0 if encoder.shared else column]
    bins = getattr(source, "bins", None)
    if bins is None:
        return torch.linspace(0, 1, _GRID, dtype=torch.float64)
    return (torch.arange(bins, dtype=torch.float64) + 0.5) / bins


def _differ(one: Float64[Tensor, "batch 1 m"], other: Float64[Tensor, "batch c m"]) -> Bool[Tensor, "batch c"]:
    return ((one != other) & ~(one.isnan() & other.isnan())).any(-1)


def _margin_drop(
    margin: Float[Tensor, "batch 1"], without: Float[Tensor, "batch n"], changed: Bool[Tensor, "batch n"]
) -> Float[Tensor, "batch n"]:
    # The margins of a single result are infinite, and their difference is none.
    return (margin - torch.where(changed, -without, without)).nan_to_num(nan=0.0, posinf=torch.inf)


def _speakers(controller: Controller, recall: Recall) -> tuple[str, ...]:
    if recall.speaker is None:
        return (str(getattr(controller, "name", "")),) * len(recall.commands)
    names: Any = getattr(controller, "names", ())
    return tuple(names[index] if index >= 0 else "" for index in recall.speaker.tolist())


def _nearest(
    schema: Schema,
    rows: Float64[Tensor, "batch n"],
    column: Int64[Tensor, "c"],
    value: Float64[Tensor, "c"],
    moves: Bool[Tensor, "batch c"],
    commands: Float64[Tensor, "batch c m"],
) -> tuple[Change | None, ...]:
    """The smallest of the changes that move the commands, for each row."""
    size = torch.stack(
        [_sizes(schema.sensors[c], rows[:, c], v) for c, v in zip(column.tolist(), value, strict=True)], 1
    )
    # A sensor that was not observed has no reading that could move.
    smallest = size.masked_fill(~moves | size.isnan(), torch.inf).min(-1)
    found: list[Change | None] = []
    for row, (least, index) in enumerate(zip(smallest.values.tolist(), smallest.indices.tolist(), strict=True)):
        sensor = schema.sensors[int(column[index])].name
        change = Change(sensor, float(value[index]), least, tuple(commands[row, index].tolist()))
        found.append(change if least < torch.inf else None)
    return tuple(found)


def _sizes(sensor: Sensor, readings: Float64[Tensor, "batch"], value: Tensor) -> Float64[Tensor, "batch"]:
    """The distance from each reading to a value, as a fraction of the range; that of two categories is 1."""
    if sensor.choices:
        return torch.where(readings.isnan(), torch.nan, (readings != value).to(torch.float64))
    size = (readings - value).abs() / (sensor.high - sensor.low)
    return torch.minimum(size, 1 - size) if sensor.kind == "angle" else size


def _reading(sensor: Sensor, value: float) -> str:
    if value != value:
        return f"{sensor.name} not observed"
    text = str(sensor.values[int(value)]) if sensor.labels else f"{value:.3g}"
    return f"{sensor.name} = {text}" + (f" {sensor.unit}" if sensor.unit else "")


def _commands(actuators: Any, values: Any) -> str:
    return _listed([command_text(*pair) for pair in zip(actuators, values, strict=True)])


def command_text(actuator: Actuator, value: float) -> str:
    """A command with the name and the unit of its actuator."""
    return f"{actuator.name} = {value:.3g}" + (f" {actuator.unit}" if actuator.unit else "")


def _listed(parts: list[str], word: str = "and") -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} {word} {parts[-1]}"
