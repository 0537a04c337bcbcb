"""Ranges, bins and levels, against the definition in words; errors that name what is wrong."""

import json
import math
from typing import Any, Literal, cast

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from behaviours import Actuator, Demonstrations, OneShot, Schema, Sensor, Space
from behaviours.edges import quantile_edges
from torchvsa import MAP, ShapeError
from torchvsa.encoders import Lookup, Sum


def schema(
    low: float = 0, high: float = 4, levels: int = 3, out_of_range: Literal["error", "clip"] = "error"
) -> Schema:
    return Schema([Sensor("eye", low, high, "m", out_of_range)], [Actuator("wheel", low, high, "m/s", levels)])


def bins_of(made: Schema, readings: Any, bins: int) -> torch.Tensor:
    """Readings as an encoder with so many bins sees them."""
    return Space(made, Sum(Lookup(MAP(8), bins), len(made.sensors))).cells(readings)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    low=st.integers(-50, 50), span=st.integers(1, 100), bins=st.sampled_from([1, 2, 3, 7, 16, 64]), at=st.floats(0, 1)
)
def test_a_reading_lies_in_the_bin_that_holds_it(low: int, span: int, bins: int, at: float) -> None:
    reading = low + at * span
    edges = [low + span * b / bins for b in range(bins + 1)]
    if not 0 < at < 1 or min(abs(reading - edge) for edge in edges) > 1e-9:
        held = sum(reading >= edge for edge in edges[1:-1])
        assert bins_of(schema(low, low + span), [[reading]], bins).item() == held


def test_edges_belong_to_the_bin_above_and_both_bounds_count() -> None:
    readings = [[0.0], [0.999], [1.0], [2.0], [3.0], [3.999], [4.0], [math.nan], [-0.0]]
    assert bins_of(schema(), readings, 4).flatten().tolist() == [0, 0, 1, 2, 3, 3, 3, -1, 0]
    assert bins_of(schema(-1, 1), [[-1.0], [0.0], [1.0]], 2).flatten().tolist() == [0, 1, 1]


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
    made = schema(out_of_range="clip")
    assert made.check_readings([[-7.0], [9.0], [2.5]]).flatten().tolist() == [0.0, 4.0, 2.5]
    assert bins_of(made, [[-7.0], [9.0]], 4).flatten().tolist() == [0, 3]
    assert made.check_readings([[math.nan]]).isnan().all()


def test_readings_out_of_range_name_sensor_range_and_row() -> None:
    with pytest.raises(
        ValueError, match=r"sensor 'eye' reads 4.5 in row 1; its range is \[0, 4\] m.*out_of_range='clip'"
    ):
        bins_of(schema(), [[1.0], [4.5]], 4)


@pytest.mark.parametrize("out_of_range", ["error", "clip"])
@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_infinite_readings_are_never_accepted(out_of_range: Literal["error", "clip"], value: float) -> None:
    with pytest.raises(ValueError, match=rf"sensor 'eye' reads {value} in row 2; its range is \[0, 4\] m"):
        bins_of(schema(out_of_range=out_of_range), [[1.0], [math.nan], [value]], 4)


@pytest.mark.parametrize("value", [math.nan, math.inf, -0.1, 4.1])
def test_commands_out_of_range_name_actuator_range_and_row(value: float) -> None:
    message = rf"actuator 'wheel' has the command {value:g} in row 1; its range is \[0, 4\] m/s"
    with pytest.raises(ValueError, match=message):
        schema().command_levels([[1.0], [value]])


@pytest.mark.parametrize("rows", [[1.0], [[1.0, 2.0]], [[[1.0]]], 1.0])
def test_rows_of_another_shape(rows: object) -> None:
    with pytest.raises(ShapeError, match=r"rows of 1 values \(eye\), shape \[batch, 1\]; got shape"):
        bins_of(schema(), rows, 4)
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
    with pytest.raises(ValueError, match="out_of_range is 'error' or 'clip'; got 'wrap'"):
        Sensor("x", 0, 1, out_of_range=cast(Literal["clip"], "wrap"))
    with pytest.raises(ValueError, match="'x': levels is a whole number from 2 to 2147483648; got 1"):
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


@pytest.mark.parametrize("part", [Sensor, Actuator])
@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (-1e308, 1e308, "'x' needs a finite range with low < high, whose width"),
        (0, 10**400, "'x' needs a finite range"),
        ("0", 1, "'x': low must be a real number; got '0'"),
        (0, 1 + 0j, "'x': high must be a real number"),
        (False, True, "'x': low must be a real number; got False"),
        (0, None, "'x': high must be a real number; got None"),
    ],
)
def test_bounds_are_finite_real_numbers(part: Any, low: Any, high: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        part("x", low, high)


@pytest.mark.parametrize("part", [Sensor, Actuator])
def test_names_and_units_are_strings(part: Any) -> None:
    with pytest.raises(ValueError, match="needs a name, a string; got 3"):
        part(3, 0, 1)
    with pytest.raises(ValueError, match="'x': unit must be a string; got 2"):
        part("x", 0, 1, unit=2)


def test_bounds_of_numpy_and_torch_are_kept_as_plain_numbers() -> None:
    made = Sensor("x", cast(float, np.float32(0)), cast(float, torch.tensor(4.5)))
    assert json.dumps([made.low, made.high]) == "[0.0, 4.5]"
    assert (type(Sensor("x", cast(float, np.int64(1)), 2).low), Sensor("x", 1, 2).low) == (int, 1)


@pytest.mark.parametrize("levels", [2.5, 2.0, True, np.bool_(True), "3", None, 2**31 + 1, 10**30, math.nan])
def test_levels_are_a_whole_number(levels: Any) -> None:
    with pytest.raises(ValueError, match=r"actuator 'x': levels is a whole number from 2 to 2147483648; got"):
        Actuator("x", 0, 1, levels=levels)


def test_levels_of_numpy_are_kept_as_a_plain_integer() -> None:
    made = Actuator("x", 0, 1, levels=cast(int, np.int64(5)))
    assert made == Actuator("x", 0, 1, levels=5)
    assert type(made.levels) is int


@pytest.mark.parametrize(("low", "high"), [(1e16, 1e16 + 4), (0, 5e-323), (-5e307, 5e307)])
def test_ranges_in_which_floats_tell_no_bins_or_levels_apart(low: float, high: float) -> None:
    made = Schema([Sensor("x", low, high)], [Actuator("y", 0, 1)])
    with pytest.raises(ValueError, match=r"sensor 'x': 32 bins of the range .* cannot be told apart in float64"):
        bins_of(made, [[low]], 32)
    with pytest.raises(ValueError, match=r"actuator 'y': 21 levels of the range .* cannot be told apart in float64"):
        Actuator("y", low, high)


@pytest.mark.parametrize(("low", "high"), [(1e15, 1e15 + 40), (0, 1e-300), (-1e305, 1e305), (1e300, 1.5e300)])
@pytest.mark.parametrize("levels", [2, 3, 20])
def test_levels_of_extreme_ranges_come_back(low: float, high: float, levels: int) -> None:
    made = Schema([Sensor("x", low, high)], [Actuator("y", low, high, levels=levels)])
    values = made.command_values(torch.arange(levels)[:, None])
    assert values.isfinite().all()
    assert made.command_levels(values).flatten().tolist() == list(range(levels))
    bins = bins_of(made, values, levels - 1).flatten()
    assert (bins - torch.arange(levels).clamp(max=levels - 2)).abs().max() <= 1
    assert bins_of(made, [[low], [high]], levels).flatten().tolist() == [0, levels - 1]


TWO = Schema([Sensor("left", 0, 4), Sensor("right", 0, 4)], [Actuator("wheel", -1, 1)])


def test_a_frame_has_the_columns_of_the_schema() -> None:
    frame = pd.DataFrame({"left": [1.0, np.nan], "right": [3, 4]})
    assert bins_of(TWO, frame, 4).tolist() == [[1, 3], [-1, 3]]
    assert bins_of(TWO, frame.to_numpy(), 4).tolist() == [[1, 3], [-1, 3]]
    assert TWO.command_levels(pd.DataFrame({"wheel": [0.0]})).tolist() == [[10]]
    # Columns that are only counted have no names.
    assert bins_of(TWO, pd.DataFrame([[1.0, 3.0]]), 4).tolist() == [[1, 3]]
    space = Space(TWO, vsa=MAP(64))
    behaviour = OneShot().fit(space, Demonstrations(frame[:1], [[0.5]]))
    assert behaviour(frame[:1]).commands.tolist() == [[0.5]]
    with pytest.raises(ValueError, match="order differs; expected left, right; got right, left"):
        behaviour(frame[["right", "left"]])
    with pytest.raises(ValueError, match=r"sensor readings .* missing: right; unknown: front; expected left, right"):
        TWO.check_readings(frame.rename(columns={"right": "front"}))
    with pytest.raises(ValueError, match=r"commands .* unknown: motor"):
        TWO.command_levels(pd.DataFrame({"motor": [0.0]}))
    with pytest.raises(ValueError, match="names of columns must all be strings"):
        TWO.check_readings(frame.rename(columns={"right": 1}))


@pytest.mark.parametrize(
    "rows",
    [
        [[1.0, None]],
        [[1.0, "2"]],
        [["1", "2"]],
        [[1.0, 2j]],
        np.array([[1.0, 2j]]),
        torch.tensor([[1.0, 2j]]),
        pd.DataFrame({"left": ["near"], "right": ["far"]}),
        [[1.0, 2.0], [1.0]],
        [[1.0, 10**400]],
        None,
        object(),
        np.array([["2020-01-01", "2020-01-02"]], dtype="datetime64[D]"),
    ],
)
def test_readings_are_real_numbers(rows: Any) -> None:
    with pytest.raises(ValueError, match=r"sensor readings (must|cannot)"):
        TWO.check_readings(rows)
    with pytest.raises(ValueError, match=r"(sensors|commands) (must|cannot)"):
        Demonstrations(rows, rows)


def test_missing_values_of_a_table_are_not_observed() -> None:
    frame = pd.DataFrame({"left": pd.array([1, None], dtype="Int64"), "right": [True, False]})
    np.testing.assert_array_equal(TWO.check_readings(frame), [[1, 1], [math.nan, 0]])
    masked = np.ma.masked_array([[1.0, 2.0]], [[False, True]])
    np.testing.assert_array_equal(TWO.check_readings(masked), [[1, math.nan]])


def test_one_row_is_written_as_a_batch() -> None:
    with pytest.raises(ShapeError, match=r"got shape \(2,\); write one row as a batch of one, \[row\]"):
        TWO.check_readings([1.0, 2.0])


def test_parts_of_a_schema_are_sensors_and_actuators() -> None:
    with pytest.raises(ValueError, match="the sensors of a schema must be of type Sensor"):
        Schema(cast(Any, ["left"]), [Actuator("wheel", 0, 1)])
    with pytest.raises(ValueError, match="the actuators of a schema must be of type Actuator"):
        Schema([Sensor("left", 0, 1)], cast(Any, [Sensor("wheel", 0, 1)]))


def test_quantile_edges_of_readings_that_span_the_floats() -> None:
    assert quantile_edges([-1.7e308, 1.7e308], 2).tolist() == [0.0]
    for wrong in ([0.0, math.inf], [1j, 2.0], ["a", "b"]):
        with pytest.raises(ValueError, match="readings must be"):
            quantile_edges(wrong, 2)
    with pytest.raises(ValueError, match="at least one bin; got 0"):
        quantile_edges([0.0, 1.0], 0)
    with pytest.raises(ValueError, match=r"the edges of 1,000,000,000,000 bins needs .* take fewer bins"):
        quantile_edges([0.0, 1.0], 10**12)
