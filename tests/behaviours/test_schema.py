"""Ranges, bins and levels, against the definition in words; errors that name what is wrong."""

import math
from typing import Literal, cast

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from behaviours import Actuator, Schema, Sensor
from torchvsa import ShapeError


def schema(low: float = 0, high: float = 4, levels: int = 3, beyond: Literal["error", "clip"] = "error") -> Schema:
    return Schema([Sensor("eye", low, high, "m", beyond)], [Actuator("wheel", low, high, "m/s", levels)])


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    low=st.integers(-50, 50), span=st.integers(1, 100), bins=st.sampled_from([1, 2, 3, 7, 16, 64]), at=st.floats(0, 1)
)
def test_a_reading_lies_in_the_bin_that_holds_it(low: int, span: int, bins: int, at: float) -> None:
    reading = low + at * span
    edges = [low + span * b / bins for b in range(bins + 1)]
    if not 0 < at < 1 or min(abs(reading - edge) for edge in edges) > 1e-9:
        held = sum(reading >= edge for edge in edges[1:-1])
        assert schema(low, low + span).sensor_bins([[reading]], bins).item() == held


def test_edges_belong_to_the_bin_above_and_both_bounds_count() -> None:
    readings = [[0.0], [0.999], [1.0], [2.0], [3.0], [3.999], [4.0], [math.nan], [-0.0]]
    assert schema().sensor_bins(readings, 4).flatten().tolist() == [0, 0, 1, 2, 3, 3, 3, -1, 0]
    assert schema(-1, 1).sensor_bins([[-1.0], [0.0], [1.0]], 2).flatten().tolist() == [0, 1, 1]


def test_halves_go_to_the_upper_level() -> None:
    # Levels of [0, 4] in 3: 0, 2, 4.
    levels = schema().command_levels([[0.0], [0.999], [1.0], [2.999], [3.0], [4.0]])
    assert levels.flatten().tolist() == [0, 0, 1, 1, 2, 2]
    assert schema().command_values(levels).flatten().tolist() == [0, 0, 2, 2, 4, 4]


@settings(max_examples=100, deadline=None, derandomize=True)
@given(levels=st.integers(2, 40), low=st.integers(-9, 9), span=st.integers(1, 20), at=st.floats(0, 1))
def test_a_command_takes_the_nearest_level(levels: int, low: int, span: int, at: float) -> None:
    made = schema(low, low + span, levels)
    values = np.linspace(low, low + span, levels)
    command = low + at * span
    level = made.command_levels([[command]])
    assert abs(values[int(level)] - command) <= np.abs(values - command).min() + 1e-9
    assert made.command_values(level).item() == pytest.approx(values[int(level)])
    np.testing.assert_array_equal(
        made.command_levels(made.command_values(torch.arange(levels)[:, None])).flatten(), range(levels)
    )


def test_beyond_the_range_clips_where_declared() -> None:
    made = schema(beyond="clip")
    assert made.check_readings([[-7.0], [9.0], [2.5]]).flatten().tolist() == [0.0, 4.0, 2.5]
    assert made.sensor_bins([[-7.0], [9.0]], 4).flatten().tolist() == [0, 3]
    assert made.check_readings([[math.nan]]).isnan().all()


def test_readings_out_of_range_name_sensor_range_and_row() -> None:
    with pytest.raises(ValueError, match=r"sensor 'eye' reads 4.5 in row 1; its range is \[0, 4\] m.*beyond='clip'"):
        schema().sensor_bins([[1.0], [4.5]], 4)


@pytest.mark.parametrize("beyond", ["error", "clip"])
@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_infinite_readings_are_never_accepted(beyond: Literal["error", "clip"], value: float) -> None:
    with pytest.raises(ValueError, match=rf"sensor 'eye' reads {value} in row 2; its range is \[0, 4\] m"):
        schema(beyond=beyond).sensor_bins([[1.0], [math.nan], [value]], 4)


@pytest.mark.parametrize("value", [math.nan, math.inf, -0.1, 4.1])
def test_commands_out_of_range_name_actuator_range_and_row(value: float) -> None:
    with pytest.raises(ValueError, match=rf"actuator 'wheel' is told {value:g} in row 1; its range is \[0, 4\] m/s"):
        schema().command_levels([[1.0], [value]])


@pytest.mark.parametrize("rows", [[1.0], [[1.0, 2.0]], [[[1.0]]], 1.0])
def test_rows_of_another_shape(rows: object) -> None:
    with pytest.raises(ShapeError, match=r"rows of 1 values \(eye\), shape \[batch, 1\]; got shape"):
        schema().sensor_bins(rows, 4)
    with pytest.raises(ShapeError, match=r"rows of 1 values \(wheel\)"):
        schema().command_levels(rows)


@pytest.mark.parametrize(("low", "high"), [(1, 1), (2, 1), (0, math.inf), (math.nan, 1)])
@pytest.mark.parametrize("part", [Sensor, Actuator])
def test_ranges_must_be_ranges(part: type[Sensor | Actuator], low: float, high: float) -> None:
    with pytest.raises(ValueError, match="'x' needs a finite range with low < high"):
        part("x", low, high)


def test_parts_that_make_no_sense() -> None:
    with pytest.raises(ValueError, match="every sensor needs a name"):
        Sensor("", 0, 1)
    with pytest.raises(ValueError, match="beyond is 'error' or 'clip'; got 'wrap'"):
        Sensor("x", 0, 1, beyond=cast(Literal["clip"], "wrap"))
    with pytest.raises(ValueError, match="'x' needs at least 2 levels; got 1"):
        Actuator("x", 0, 1, levels=1)
    with pytest.raises(ValueError, match="at least one sensor"):
        Schema([], [Actuator("x", 0, 1)])
    with pytest.raises(ValueError, match="at least one actuator"):
        Schema([Sensor("x", 0, 1)], [])
    with pytest.raises(ValueError, match="sensor names must differ; got x, x"):
        Schema([Sensor("x", 0, 1), Sensor("x", 0, 2)], [Actuator("x", 0, 1)])


def test_a_schema_survives_plain_values() -> None:
    made = Schema([Sensor("a", 0, 1, "m", "clip"), Sensor("b", -1, 1)], [Actuator("c", 0, 2, "V", 5)])
    assert Schema.from_dict(made.to_dict()) == made
