"""Sensors of every kind: what they read, where it is in [0, 1], and errors that name what is wrong."""

import json
import math
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from behaviours import Actuator, Demonstrations, Schema, Sensor
from torchvsa import ShapeError

WHEEL = [Actuator("wheel", -1, 1, levels=3)]
GEAR = Sensor("gear", kind="categorical", values=("low", "high", "reverse"))
ROBOT = Schema(
    [
        Sensor("distance", 0, 4, unit="m"),
        Sensor("bumper", kind="binary"),
        GEAR,
        Sensor("heading", -180, 180, unit="deg", kind="angle"),
    ],
    WHEEL,
)
NAN = math.nan


def normalised(sensor: Sensor, *readings: Any) -> list[float]:
    return Schema([sensor], WHEEL).normalise([[reading] for reading in readings]).flatten().tolist()


def checked(sensor: Sensor, *readings: Any) -> list[float]:
    return Schema([sensor], WHEEL).check_readings([[reading] for reading in readings]).flatten().tolist()


def test_each_kind_has_its_place_between_0_and_1() -> None:
    x = ROBOT.normalise([[1, True, "high", 90], [4, False, "low", -180], [0, 1, 2, 180], [NAN, NAN, NAN, NAN]])
    assert x.dtype == torch.float64
    np.testing.assert_array_equal(
        x, [[0.25, 1, 1.5 / 3, 0.75], [1, 0, 0.5 / 3, 0], [0, 1, 2.5 / 3, 0], [NAN, NAN, NAN, NAN]]
    )


@pytest.mark.parametrize(
    "rows",
    [
        [[1.0, True, "high", 90], [2.0, False, "low", 0]],
        [[1.0, 1, 1, 90], [2.0, 0, 0, 0]],
        torch.tensor([[1.0, 1, 1, 90], [2, 0, 0, 0]]),
        np.array([[1.0, True, "high", 90], [2.0, 0, 0, 0]], dtype=object),
        np.ma.masked_array(np.array([[1.0, True, "high", 90], [2.0, 0, "low", 0]], dtype=object), mask=False),
        pd.DataFrame({"distance": [1.0, 2], "bumper": [True, False], "gear": ["high", "low"], "heading": [90, 0]}),
        pd.DataFrame(
            {"distance": [1, 2], "bumper": [1, 0], "gear": pd.Categorical(["high", "low"]), "heading": [90.0, 0]}
        ),
    ],
)
def test_text_and_indices_are_the_same_however_they_come(rows: Any) -> None:
    assert ROBOT.check_readings(rows).tolist() == [[1, 1, 1, 90], [2, 0, 0, 0]]
    assert ROBOT.numeric(rows).tolist() == [[1, 1, 1, 90], [2, 0, 0, 0]]


def test_what_is_missing_in_a_column_of_text_was_not_observed() -> None:
    columns = {"distance": [1.0, 2], "bumper": [True, None], "gear": ["low", None], "heading": [3, 4]}
    wanted = [[1, 1, 0, 3], [2, NAN, NAN, 4]]
    np.testing.assert_array_equal(ROBOT.check_readings(pd.DataFrame(columns)), wanted)
    typed = columns | {"bumper": pd.array([True, None], dtype="boolean"), "gear": pd.Categorical(["low", None])}
    np.testing.assert_array_equal(ROBOT.check_readings(pd.DataFrame(typed)), wanted)
    masked = np.ma.masked_array(np.array([[2.0, 0, "low", 4]], dtype=object), [[False, True, True, False]])
    np.testing.assert_array_equal(ROBOT.check_readings(masked), wanted[1:])


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=12, unique=True))
def test_numbers_are_read_as_they_are_and_keep_their_order(values: list[float]) -> None:
    sensor = Sensor("tag", kind="categorical", values=values)
    assert checked(sensor, *values) == values
    places = normalised(sensor, *values)
    assert [math.floor(place * len(values)) for place in places] == list(range(len(values)))
    assert places == [(i + 0.5) / len(values) for i in range(len(values))]


@settings(max_examples=200, deadline=None, derandomize=True)
@given(low=st.integers(-720, 720), width=st.integers(1, 720), at=st.integers(0, 719), turns=st.integers(-9, 9))
def test_an_angle_is_the_same_after_whole_turns(low: int, width: int, at: int, turns: int) -> None:
    sensor = Sensor("heading", low, low + width, kind="angle")
    reading = low + at * width / 720
    (x,) = normalised(sensor, reading + turns * width)
    assert 0 <= x < 1
    off = abs(x - at / 720)
    assert min(off, 1 - off) < 1e-9
    assert low <= checked(sensor, reading + turns * width)[0] <= low + width


def test_angles_as_large_as_floats_are_somewhere_on_the_circle() -> None:
    for low, high in ((-1, 1), (-8e307, 9e307), (0, 1e-300)):
        sensor = Sensor("heading", low, high, kind="angle")
        assert all(0 <= x < 1 for x in normalised(sensor, 1.7e308, -1.7e308, low, high, 5e-324, -5e-324))


WRONG: dict[str, Any] = {
    r"sensor 'bumper' reads 0.5 in row 1; it is binary: 0 or 1": [[1, 0, 0, 0], [1, 0.5, 0, 0]],
    r"sensor 'bumper' reads -1 in row 0; it is binary": [[1, -1, 0, 0]],
    r"'gear' reads 3 in row 0; its values are 'low', 'high', 'reverse', or their indices 0 to 2": [[1, 0, 3, 0]],
    r"'gear' reads 0.5 in row 0; its values": torch.tensor([[1, 0, 0.5, 0]]),
    r"'gear' reads the text 'top' in row 1; its values are 'low', 'high', 'reverse'": [[1, 0, 0, 0], [1, 0, "top", 0]],
    r"'heading' reads inf in row 0; it is an angle: any finite number, of which -180 and 180 deg": [
        [1, 0, 0, math.inf]
    ],
    r"'distance' reads 5 in row 0; its range is \[0, 4\] m .*out_of_range='clip'": [[5, 0, 0, 0]],
    r"'bumper' reads the text 'yes' in row 0; it is binary: 0 or 1, False or True": [[1, "yes", "low", 0]],
    r"'distance' reads the text '1' in row 0; .* numbers and text are lists": np.array([["1", "0", "low", "0"]]),
    r"must be real numbers \(NaN for 'not observed'\); got None in row 0": [[1, 0, None, 0]],
    r"their order differs": pd.DataFrame([[1, "low", 0, 0]], columns=["distance", "gear", "bumper", "heading"]),
}


@pytest.mark.parametrize("words", WRONG)
def test_wrong_readings_name_sensor_row_and_what_is_allowed(words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ROBOT.normalise(WRONG[words])


def test_rows_with_text_have_a_shape_too() -> None:
    with pytest.raises(ShapeError, match=r"shape \[batch, 4\]; got shape \(4,\); write one row as a batch of one"):
        ROBOT.normalise([1, 0, "low", 0])
    with pytest.raises(ShapeError, match=r"got shape \(1, 3\)"):
        ROBOT.normalise([[1, 0, "low"]])


def test_numbers_that_are_none_of_many_values() -> None:
    sensor = Sensor("tag", kind="categorical", values=range(100, 120), unit="Hz")
    with pytest.raises(
        ValueError, match=r"'tag' reads 99 in row 0; its values are 100, .*, 109, \.\.\. \(20 in all\) Hz$"
    ):
        normalised(sensor, 99)
    with pytest.raises(ValueError, match="sensor readings must be real numbers; got text, such as '100'"):
        normalised(sensor, "100")


SENSELESS: list[tuple[str, dict[str, Any]]] = [
    ("kind is 'real', 'angle', 'binary' or 'categorical'; got 'round'", {"kind": "round"}),
    ("'x' needs a finite range with low < high", {}),
    ("'x' needs a finite range with low < high", {"kind": "angle"}),
    ("'x' needs a finite range with low < high", {"kind": "angle", "low": 1, "high": 1}),
    ("'x': only real sensors have a nearest bound, out_of_range='clip'", {"kind": "binary", "out_of_range": "clip"}),
    ("'x': only a categorical sensor has values; this one is 'real'", {"low": 0, "high": 1, "values": (0, 1)}),
    ("'x': only a categorical sensor has values; this one is 'binary'", {"kind": "binary", "values": (0, 1)}),
    ("'x' is binary, and its values define its range; leave out high=2", {"kind": "binary", "low": 0, "high": 2}),
    ("'x' is categorical, and its values define its range; leave out low=None", {"values": ["a", "b"], "low": None}),
    ("'x' is categorical and needs at least two values; got []", {"values": ()}),
    ("'x' is categorical and needs at least two values; got ['a']", {"values": ["a"]}),
    ("'x': values are a sequence such as ('low', 'high'); got 'ab'", {"values": "ab"}),
    ("'x': values are a sequence such as ('low', 'high'); got 3", {"values": 3}),
    ("'x': values are a sequence such as ('low', 'high'); got tensor(3)", {"values": torch.tensor(3)}),
    ("'x': values are all strings, or all real numbers; got ['a', 1]", {"values": ("a", 1)}),
    ("'x': values are all strings, or all real numbers; got [True, False]", {"values": (True, False)}),
    ("'x': values are all strings, or all real numbers; got [None, 1]", {"values": (None, 1)}),
    ("'x': values must be finite and differ from each other; got ['a', 'b', 'a']", {"values": ("a", "b", "a")}),
    ("'x': values must be finite and differ from each other; got [1, 1.0]", {"values": (1, 1.0)}),
    ("'x': values must be finite and differ from each other; got [0.0, -0.0]", {"values": (0.0, -0.0)}),
    ("'x': values must be finite and differ from each other; got [nan, 1]", {"values": (NAN, 1)}),
    ("'x': values must be finite and differ from each other; got [1, inf]", {"values": (1, math.inf)}),
    ("'x': values must be finite and differ from each other", {"values": (2**53, 2**53 + 1)}),
    ("'x': values must be finite and differ from each other", {"values": (1, 10**400)}),
]


@pytest.mark.parametrize(("words", "options"), SENSELESS)
def test_sensors_that_make_no_sense(words: str, options: dict[str, Any]) -> None:
    categorical = (
        {"kind": "categorical"} if "kind" not in options and "values" in options and "high" not in options else {}
    )
    with pytest.raises(ValueError) as raised:  # noqa: PT011 the words are compared below, without patterns
        Sensor("x", **categorical, **options)
    assert words in str(raised.value)


def test_a_schema_of_all_kinds_survives_json() -> None:
    again = Schema.from_dict(json.loads(json.dumps(ROBOT.to_dict())))
    assert again == ROBOT
    assert hash(again.sensors) == hash(ROBOT.sensors)
    numbers = Sensor("tag", kind="categorical", values=cast(Any, np.array([3, 1.5])))
    assert json.dumps(numbers.values) == "[3.0, 1.5]"
    assert Sensor("tag", numbers.low, numbers.high, kind="categorical", values=(3.0, 1.5)) == numbers


def test_only_what_differs_from_the_default_is_written() -> None:
    real, binary, gear, angle = ROBOT.to_dict()["sensors"]
    assert list(real) == ["name", "low", "high", "unit", "out_of_range"]
    assert binary == {"name": "bumper", "low": 0, "high": 1, "unit": "", "out_of_range": "error", "kind": "binary"}
    assert (gear["low"], gear["high"], gear["kind"], gear["values"]) == (0, 2, "categorical", GEAR.values)
    assert "values" not in angle


def test_demonstrations_read_text_with_a_schema() -> None:
    frame = pd.DataFrame({"distance": [1.0, 5], "bumper": [True, False], "gear": ["high", None], "heading": [90, 999]})
    shown = Demonstrations(frame[:1], [[1.0]], schema=ROBOT)
    assert shown.sensors.tolist() == [[1, 1, 1, 90]]
    assert shown.sensor_names == ("distance", "bumper", "gear", "heading")
    shown.check(ROBOT)
    with pytest.raises(ValueError, match="'distance' reads 5 in row 1"):
        Demonstrations(frame, [[1.0], [1.0]], schema=ROBOT)
    with pytest.raises(ValueError, match="'wheel' has the command 2"):
        Demonstrations(frame[:1], [[2.0]], schema=ROBOT)
    with pytest.raises(ValueError, match=r"sensors must be real numbers; got the text 'high' in row 0 \(give schema="):
        Demonstrations(frame[:1], [[1.0]])
    series = Demonstrations(pd.Series(["high", "low"], name="gear"), [[1.0], [0]], schema=Schema([GEAR], WHEEL))
    assert (series.sensors.tolist(), series.sensor_names) == ([[1], [0]], ("gear",))


def test_graphs_take_the_nearest_choice() -> None:
    function = cast(Any, torch.compile(ROBOT.normalise, fullgraph=True, backend="eager"))
    rows = torch.tensor([[9, 0.2, 1.4, 190], [1, 7, -3, math.inf], [NAN] * 4, [1, 0, 2, 90]], dtype=torch.float64)
    wanted = [[1, 0, 1.5 / 3, 10 / 360], [0.25, 1, 0.5 / 3, NAN], [NAN] * 4, [0.25, 0, 2.5 / 3, 0.75]]
    np.testing.assert_allclose(function(rows), wanted, rtol=1e-15)
    tags = Schema([Sensor("tag", kind="categorical", values=(7, 3, 30))], WHEEL)
    function = cast(Any, torch.compile(tags.normalise, fullgraph=True, backend="eager"))
    rows = torch.tensor([[-math.inf], [4.9], [5.1], [18.4], [18.6], [NAN]], dtype=torch.float64)
    np.testing.assert_array_equal(function(rows).flatten() * 3, [1.5, 1.5, 0.5, 0.5, 2.5, NAN])
    torch.compiler.reset()
