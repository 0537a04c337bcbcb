"""Validate readings of real, angular, binary and categorical sensors, and map them to [0, 1]."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import torch
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from behaviours.parts import Sensor


def valid_readings(
    sensors: Sequence[Sensor], rows: Float64[Tensor, "batch n"], inside: Bool[Tensor, "batch n"]
) -> Bool[Tensor, "batch n"]:
    """Whether each reading is valid, given whether it is `inside` its range; NaN is not valid."""
    whole, angle = _flags(sensors, _is_whole, rows), _flags(sensors, _is_angle, rows)
    valid = (inside & ((rows == rows.floor()) | ~whole)) | (angle & rows.isfinite())
    choices = _columns(sensors, rows, lambda sensor, column: _choice(sensor, _nearest(sensor, column)) == column)
    return _with_columns(valid, choices)


def canonical(
    sensors: Sequence[Sensor],
    rows: Float64[Tensor, "batch n"],
    low: Float64[Tensor, "n"],
    high: Float64[Tensor, "n"],
) -> Float64[Tensor, "batch n"]:
    """Readings within their ranges: angles are wrapped, others clipped, and choices rounded to the nearest one."""
    width = high - low
    # Two remainders, since `rows - low` may overflow.
    wrapped = low + torch.remainder(torch.remainder(rows, width) - torch.remainder(low, width), width)
    clipped = torch.minimum(torch.maximum(rows, low), high)
    inside = (rows >= low) & (rows <= high)
    rows = torch.where(_flags(sensors, _is_angle, rows) & ~inside, wrapped, clipped)
    rows = torch.where(_flags(sensors, _is_whole, rows), (rows + 0.5).floor(), rows)
    nearest = _columns(sensors, rows, lambda sensor, column: _choice(sensor, _nearest(sensor, column)))
    return torch.where(rows.isnan(), rows, _with_columns(rows, nearest))


def to_unit_interval(sensors: Sequence[Sensor], rows: Float64[Tensor, "batch n"]) -> Float64[Tensor, "batch n"]:
    """Map valid readings to [0, 1], see `Schema.normalise`."""
    indices = _columns(sensors, rows, lambda sensor, column: _nearest(sensor, column).to(column.dtype))
    ranges = [(-0.5, len(sensor.values) - 0.5) if sensor.values else (sensor.low, sensor.high) for sensor in sensors]
    low, high = torch.tensor(ranges, dtype=torch.float64, device=rows.device).unbind(1)
    x = (_with_columns(rows, indices) - low) / (high - low)
    x = torch.where(_flags(sensors, _is_angle, rows) & (x >= 1), 0, x)
    return torch.where(rows.isnan(), rows, x) if indices else x


def _is_angle(sensor: Sensor) -> bool:
    return sensor.kind == "angle"


def _is_whole(sensor: Sensor) -> bool:
    """Whether the sensor reads whole numbers from 0 on."""
    return sensor.kind == "binary" or bool(sensor.labels)


def _flags(sensors: Sequence[Sensor], predicate: Callable[[Sensor], bool], rows: Tensor) -> Bool[Tensor, "n"]:
    return torch.tensor([predicate(sensor) for sensor in sensors], device=rows.device)


def _columns(sensors: Sequence[Sensor], rows: Tensor, change: Callable[[Sensor, Tensor], Tensor]) -> dict[int, Tensor]:
    """`change` of the columns of sensors with numeric categories, by column index."""
    return {
        index: change(sensor, rows[:, index])
        for index, sensor in enumerate(sensors)
        if sensor.values and not sensor.labels
    }


def _with_columns(rows: Tensor, columns: dict[int, Tensor]) -> Tensor:
    """`rows` with these columns replaced."""
    if not columns:
        return rows
    return torch.stack([columns.get(index, column) for index, column in enumerate(rows.unbind(1))], 1)


def _choice(sensor: Sensor, indices: Int64[Tensor, "batch"]) -> Float64[Tensor, "batch"]:
    return torch.tensor(sensor.choices, dtype=torch.float64, device=indices.device)[indices]


def _nearest(sensor: Sensor, column: Float64[Tensor, "batch"]) -> Int64[Tensor, "batch"]:
    """The index of the nearest choice, found by comparisons, which ONNX supports too."""
    order = sorted(range(len(sensor.choices)), key=sensor.choices.__getitem__)
    edges = [_threshold(sensor.choices[a], sensor.choices[b]) for a, b in pairwise(order)]
    rank = (column[:, None] >= torch.tensor(edges, dtype=torch.float64, device=column.device)).sum(1)
    return torch.tensor(order, device=column.device)[rank]


def _threshold(low: float, high: float) -> float:
    """The mean of two numbers, or `high` if no float lies between them."""
    low, high = float(low), float(high)
    middle = low / 2 + high / 2
    return middle if low < middle <= high else high
