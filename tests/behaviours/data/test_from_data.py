"""`Schema.from_data` proposes sensors and actuators, and `Demonstrations.from_data` reads the columns of a schema."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
import torch

from behaviours import Actuator, BehaviourBank, Demonstrations, Schema, Sensor, Space
from behaviours.data import Log

ROWS = 400


def columns() -> dict[str, Any]:
    """A column of each kind; runs of 100 rows."""
    place = np.arange(ROWS)
    front = 0.5 + (place * 7 % 100) / 50
    front[17] = 99.0
    return {
        "run": np.repeat(["b", "a", "d", "c"], 100),
        "time": place % 100 * 0.05,
        "front": np.where(place == 3, np.nan, front),
        "heading": -179.0 + place % 360,
        "bumper": place % 2 == 1,
        "mode": np.array([["search", "follow", None][i % 3] for i in place], dtype=object),
        "note": np.array([f"row {i}" for i in place], dtype=object),
        "battery": np.full(ROWS, 12.0),
        "v": np.array([-0.2, 0.05, 0.3])[place % 3],
        "omega": np.sin(place),
    }


def proposed(**options: Any) -> tuple[Schema, list[str]]:
    lines: list[str] = []
    return Schema.from_data(columns(), ["v", "omega"], by="run", show=lines.append, **options), lines


def test_each_column_is_taken_for_what_it_is_or_left_out_with_a_reason() -> None:
    schema, lines = proposed()
    assert schema.sensors == (
        Sensor("front", 0.5, 2.48, out_of_range="clip"),
        Sensor("heading", -180, 180, unit="deg", kind="angle"),
        Sensor("bumper", kind="binary"),
        Sensor("mode", kind="categorical", values=("follow", "search")),
    )
    values = np.sin(np.arange(ROWS))
    assert schema.actuators == (Actuator("v", -0.2, 0.3, levels=3), Actuator("omega", values.min(), values.max()))
    told = dict(line.split(":", 1) for line in lines)
    assert "1 readings beyond, such as 99" in told["front"]
    assert {name for name, text in told.items() if "left out" in text} == {"run", "time", "note", "battery"}
    assert "always 12" in told["battery"]
    assert "400 different values" in told["note"]
    assert "as time does" in told["time"]


def test_corrections_replace_what_was_proposed() -> None:
    changes = {
        "front": {"low": 0, "high": 4, "unit": "m", "out_of_range": "error"},
        "heading": {"kind": "real"},
        "mode": None,
        "omega": {"levels": 5, "low": -1, "high": 1},
        "battery": {"low": 0, "high": 15},
    }
    schema, _ = proposed(changes=changes)
    assert [sensor.name for sensor in schema.sensors] == ["front", "heading", "bumper", "battery"]
    assert schema.sensors[0] == Sensor("front", 0, 4, unit="m")
    assert (schema.sensors[1].kind, schema.sensors[1].low, schema.sensors[1].high) == ("real", -179, 180)
    assert schema.actuators[1] == Actuator("omega", -1, 1, levels=5)


def test_named_sensors_are_taken_in_that_order() -> None:
    schema = Schema.from_data(columns(), ["v"], ["time", "front"], by="run")
    assert [sensor.name for sensor in schema.sensors] == ["time", "front"]


@pytest.mark.parametrize("name", ["dict", "pandas", "pyarrow", "log"])
def test_anything_with_columns_gives_the_same(name: str) -> None:
    made: dict[str, Any] = {
        "dict": dict,
        "pandas": pd.DataFrame,
        "pyarrow": lambda data: pa.Table.from_pandas(pd.DataFrame(data)),
        "log": Log,
    }
    data = made[name](columns())
    schema = Schema.from_data(data, ["v", "omega"], by="run")
    assert schema == proposed()[0]
    shown = Demonstrations.from_data(data, schema, by="run")
    given = columns()
    assert np.array_equal(shown.sensors[:, 0].numpy(), given["front"], equal_nan=True)
    indices = [{"follow": 0.0, "search": 1.0}.get(text, math.nan) for text in given["mode"]]
    assert np.array_equal(shown.sensors[:, 3].numpy(), indices, equal_nan=True)
    assert shown.episodes.tolist() == [0] * 100 + [1] * 100 + [2] * 100 + [3] * 100
    assert torch.equal(shown.commands[:, 1], torch.sin(torch.arange(ROWS, dtype=torch.float64)))
    assert shown.sensor_names == ("front", "heading", "bumper", "mode")


def test_swapped_columns_change_nothing() -> None:
    schema, _ = proposed()
    mixed = dict(reversed(columns().items()))
    straight, swapped = (Demonstrations.from_data(data, schema, by="run") for data in (columns(), mixed))
    assert torch.equal(straight.sensors.nan_to_num(-1), swapped.sensors.nan_to_num(-1))


@pytest.mark.parametrize(
    ("change", "options", "why"),
    [
        ({}, {"actuators": ["vv"]}, "there is no column 'vv'; did you mean 'v'\\?"),
        ({}, {"sensors": ["frnt"]}, "there is no column 'frnt'; did you mean 'front'\\?"),
        ({}, {"sensors": ["front", "v"]}, "column 'v' cannot be both"),
        ({}, {"actuators": None}, "which columns are commands\\?"),
        ({}, {"actuators": ["battery"]}, "'battery' is always 12"),
        ({}, {"actuators": ["mode"]}, "'mode' holds text"),
        ({}, {"by": "v"}, "'v' names the runs"),
        ({"front": ["1.0"] * 17 + ["abc"] + ["2.0"] * 382}, {"sensors": ["front"]}, "'front' .* got 'abc'.* in row 17"),
        ({"front": np.where(np.arange(ROWS) == 5, np.inf, 1.0)}, {}, "'front' is infinite in row 5"),
        ({"v": np.where(np.arange(ROWS) == 5, np.nan, 1.0)}, {}, "'v' has no finite command in row 5"),
        ({"v": np.zeros(3)}, {}, "differ in length"),
        ({}, {"changes": {"front": {"lows": 3}}}, "no option 'lows'"),
        ({}, {"changes": {"frnt": None}}, "there is no column 'frnt'"),
    ],
)
def test_mistakes_are_named_in_one_line(change: dict[str, Any], options: dict[str, Any], why: str) -> None:
    given: dict[str, Any] = {"actuators": ["v", "omega"], "by": "run"} | options
    with pytest.raises(ValueError, match=why) as caught:
        Schema.from_data(columns() | change, **given)
    assert "\n" not in str(caught.value)


def test_no_rows_and_no_columns_are_refused() -> None:
    with pytest.raises(ValueError, match="no rows, only the columns v, x"):
        Schema.from_data({"v": [], "x": []}, ["v"])
    with pytest.raises(ValueError, match="expected data with named columns"):
        Schema.from_data(np.zeros((3, 2)), ["v"])


def test_text_that_the_schema_does_not_know_is_named_with_its_row() -> None:
    schema, _ = proposed()
    data = columns()
    data["mode"][30] = "dance"
    with pytest.raises(ValueError, match="'mode' reads the text 'dance' in row 30; its values are 'follow', 'search'"):
        Demonstrations.from_data(data, schema, by="run")
    del data["mode"]
    with pytest.raises(ValueError, match="there is no column 'mode'"):
        Demonstrations.from_data(data, schema, by="run")


def test_units_travel_and_are_compared(tmp_path: Path) -> None:
    log = Log({"front": np.array([0.1, 3.0, 2.0]), "v": np.array([0.0, 1.0, 0.5])}, {"front": "m", "v": "m/s"})
    schema = Schema.from_data(log, ["v"])
    assert schema.sensors[0].unit == "m"
    shown = Demonstrations.from_data(log, schema)
    assert shown.units == {"front": "m", "v": "m/s"}
    loaded = Demonstrations.load(shown.save(tmp_path / "shown.safetensors"))
    assert loaded.units == shown.units
    assert loaded.where(loaded.commands[:, 0] > 0).units == shown.units
    assert Demonstrations.join([loaded, shown]).units == shown.units
    other = Schema([Sensor("front", 0, 4000, unit="mm")], schema.actuators)
    with pytest.raises(ValueError, match="'front' is in m in these demonstrations, and in mm in the schema"):
        BehaviourBank(Space(other)).learn("drive", loaded)
    with pytest.raises(ValueError, match="units has 'rear'"):
        Demonstrations([[1.0]], [[1.0]], sensor_names=["front"], units={"rear": "m"})
