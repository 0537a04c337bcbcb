"""What becomes of readings of several kinds: which are valid, and where they are in [0, 1]."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import torch
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from behaviours.parts import Sensor


def allowed(
    sensors: Sequence[Sensor], rows: Float64[Tensor, "batch n"], inside: Bool[Tensor, "batch n"]
) -> Bool[Tensor, "batch n"]:
    """Which readings are valid, given which of them are inside their ranges; NaN is not."""
    whole, angle = _flags(sensors, _counted, rows), _flags(sensors, _angle, rows)
    found = (inside & ((rows == rows.floor()) | ~whole)) | (angle & rows.isfinite())
    choices = _columns(sensors, rows, lambda sensor, column: _choice(sensor, _nearest(sensor, column)) == column)
    return _replaced(found, choices)


def settled(
    sensors: Sequence[Sensor],
    rows: Float64[Tensor, "batch n"],
    low: Float64[Tensor, "n"],
    high: Float64[Tensor, "n"],
) -> Float64[Tensor, "batch n"]:
    """Readings within their ranges: angles turn, the others are clipped, and choices are the nearest one."""
    width = high - low
    # Two remainders, since the difference from `low` may be beyond all floats.
    turned = low + torch.remainder(torch.remainder(rows, width) - torch.remainder(low, width), width)
    clipped = torch.minimum(torch.maximum(rows, low), high)
    inside = (rows >= low) & (rows <= high)
    rows = torch.where(_flags(sensors, _angle, rows) & ~inside, turned, clipped)
    rows = torch.where(_flags(sensors, _counted, rows), (rows + 0.5).floor(), rows)
    nearest = _columns(sensors, rows, lambda sensor, column: _choice(sensor, _nearest(sensor, column)))
    return torch.where(rows.isnan(), rows, _replaced(rows, nearest))


def placed(sensors: Sequence[Sensor], rows: Float64[Tensor, "batch n"]) -> Float64[Tensor, "batch n"]:
    """Where valid readings are in [0, 1]; see `Schema.normalise`."""
    numbers = _columns(sensors, rows, lambda sensor, column: _nearest(sensor, column).to(column.dtype))
    ranges = [(-0.5, len(sensor.values) - 0.5) if sensor.values else (sensor.low, sensor.high) for sensor in sensors]
    low, high = torch.tensor(ranges, dtype=torch.float64, device=rows.device).unbind(1)
    x = (_replaced(rows, numbers) - low) / (high - low)
    x = torch.where(_flags(sensors, _angle, rows) & (x >= 1), 0, x)
    return torch.where(rows.isnan(), rows, x) if numbers else x


def _angle(sensor: Sensor) -> bool:
    return sensor.kind == "angle"


def _counted(sensor: Sensor) -> bool:
    """Whether it reads 0, 1, 2 ..."""
    return sensor.kind == "binary" or bool(sensor.labels)


def _flags(sensors: Sequence[Sensor], which: Callable[[Sensor], bool], rows: Tensor) -> Bool[Tensor, "n"]:
    return torch.tensor([which(sensor) for sensor in sensors], device=rows.device)


def _columns(sensors: Sequence[Sensor], rows: Tensor, change: Callable[[Sensor, Tensor], Tensor]) -> dict[int, Tensor]:
    """The changed columns of sensors whose values are numbers of any size, by their places."""
    return {
        place: change(sensor, rows[:, place])
        for place, sensor in enumerate(sensors)
        if sensor.values and not sensor.labels
    }


def _replaced(rows: Tensor, columns: dict[int, Tensor]) -> Tensor:
    """A copy of rows with other columns at some places; the rows themselves if there are none."""
    if not columns:
        return rows
    return torch.stack([columns.get(place, column) for place, column in enumerate(rows.unbind(1))], 1)


def _choice(sensor: Sensor, places: Int64[Tensor, "batch"]) -> Float64[Tensor, "batch"]:
    return torch.tensor(sensor.choices, dtype=torch.float64, device=places.device)[places]


def _nearest(sensor: Sensor, column: Float64[Tensor, "batch"]) -> Int64[Tensor, "batch"]:
    """The place of the nearest choice; found by comparisons, which interchange formats of graphs know too."""
    order = sorted(range(len(sensor.choices)), key=sensor.choices.__getitem__)
    edges = [_between(sensor.choices[a], sensor.choices[b]) for a, b in pairwise(order)]
    rank = (column[:, None] >= torch.tensor(edges, dtype=torch.float64, device=column.device)).sum(1)
    return torch.tensor(order, device=column.device)[rank]


def _between(low: float, high: float) -> float:
    """A number above `low` and at most `high`: their middle, where there is one."""
    low, high = float(low), float(high)
    middle = low / 2 + high / 2
    return middle if low < middle <= high else high
