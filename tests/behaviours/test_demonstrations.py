"""Demonstrations hold what they were given, and refuse what cannot be learned."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
import torch
from robots import SCHEMA

from behaviours import Actuator, BehaviourBank, Demonstrations, ErrorDriven, Schema, Sensor, Space
from behaviours.storage import save_tensors
from torchvsa import MAP, ShapeError


def test_parts_and_joins() -> None:
    shown = Demonstrations([[1.0], [2.0], [3.0]], [[0.1], [0.2], [0.3]], [4, 4, 5])
    kept = shown.where([True, False, True])
    assert kept.sensors.tolist() == [[1.0], [3.0]]
    assert kept.commands.tolist() == [[0.1], [0.3]]
    assert kept.episodes.tolist() == [4, 5]
    joined = Demonstrations.join([kept, shown])
    assert joined.sensors.flatten().tolist() == [1, 3, 1, 2, 3]
    assert joined.commands.flatten().tolist() == [0.1, 0.3, 0.1, 0.2, 0.3]
    assert joined.episodes.tolist() == [4, 5, 4, 4, 5]
    assert Demonstrations([[1.0]], [[2.0]]).episodes.tolist() == [0]
    assert "3 rows, 1 sensors, 1 actuators, 2 episodes" in repr(shown)


@pytest.mark.parametrize("rows", [[], [[]]])
def test_empty(rows: list) -> None:
    with pytest.raises(ShapeError, match=r"sensors must be rows of values, \[N, columns\]; got shape"):
        Demonstrations(rows, rows)


def test_no_rows_of_the_right_width() -> None:
    shown = Demonstrations([[1.0]], [[2.0]])
    with pytest.raises(ValueError, match="at least one row; this one is empty"):
        shown.where([False])


def test_unequal_numbers_of_rows() -> None:
    with pytest.raises(ShapeError, match="commands has 1 rows, but sensors has 2"):
        Demonstrations([[1.0], [2.0]], [[1.0]])
    with pytest.raises(ShapeError, match="episodes has 3 rows, but sensors has 2"):
        Demonstrations([[1.0], [2.0]], [[1.0], [1.0]], [0, 0, 0])


def test_episodes_are_one_number_per_row() -> None:
    with pytest.raises(ShapeError, match=r"episodes must be one number per row, \[N\]; got shape \(2, 1\)"):
        Demonstrations([[1.0], [2.0]], [[1.0], [1.0]], [[0], [1]])


def test_infinite_readings_and_commands_that_are_no_numbers() -> None:
    with pytest.raises(ValueError, match="sensors has an infinite value in row 1, column 0; use NaN"):
        Demonstrations([[1.0], [math.inf]], [[1.0], [1.0]])
    for value in (math.nan, math.inf):
        with pytest.raises(ValueError, match=f"commands has {value} in row 0, column 1"):
            Demonstrations([[math.nan]], [[1.0, value]])


def test_check_against_a_schema() -> None:
    Demonstrations([[0.0, math.nan, 20.0]], [[-1.0, 1.0]]).check(SCHEMA)
    with pytest.raises(ValueError, match=r"sensor 'right' reads -1 in row 0; its range is \[0, 20\]"):
        Demonstrations([[0.0, -1.0, 20.0]], [[-1.0, 1.0]]).check(SCHEMA)
    with pytest.raises(ValueError, match="actuator 'left_motor' has the command 3 in row 0"):
        Demonstrations([[0.0, 1.0, 20.0]], [[3.0, 1.0]]).check(SCHEMA)
    with pytest.raises(ShapeError, match=r"sensor readings must be rows of 3 values \(left, right, front\)"):
        Demonstrations([[0.0]], [[3.0, 1.0]]).check(SCHEMA)


def test_what_is_given_is_copied() -> None:
    given = np.array([[1.0], [2.0]]), torch.tensor([[0.5], [0.25]], dtype=torch.float64), np.array([3, 4])
    shown = Demonstrations(*given)
    for array in given:
        array[:] = 9
    assert (shown.sensors.tolist(), shown.commands.tolist()) == ([[1.0], [2.0]], [[0.5], [0.25]])
    assert shown.episodes.tolist() == [3, 4]
    whole = Demonstrations(shown.sensors, shown.commands, shown.episodes)
    shown.sensors[0, 0] = math.inf
    shown.episodes[0] = 7
    assert whole.sensors[0, 0] == 1
    assert whole.episodes[0] == 3


FRAME = pd.DataFrame({"left": [1.0, np.nan, 3.0], "right": [4, 5, 6], "wheel": [0.1, 0.2, 0.3], "run": [0, 0, 1]})


def named() -> Demonstrations:
    return Demonstrations(FRAME[["left", "right"]], FRAME["wheel"], FRAME["run"])


def test_tables_keep_the_names_of_their_columns() -> None:
    shown = named()
    np.testing.assert_array_equal(shown.sensors, [[1, 4], [math.nan, 5], [3, 6]])
    assert shown.commands.flatten().tolist() == [0.1, 0.2, 0.3]
    assert shown.episodes.tolist() == [0, 0, 1]
    assert (shown.sensor_names, shown.actuator_names) == (("left", "right"), ("wheel",))
    kept = shown.where(FRAME["run"] == 0)
    assert len(kept) == 2
    assert (kept.sensor_names, kept.actuator_names) == (("left", "right"), ("wheel",))
    both = Demonstrations.join([shown, kept])
    assert len(both) == 5
    assert (both.sensor_names, both.actuator_names) == (("left", "right"), ("wheel",))
    plain = Demonstrations([[1.0, 2.0]], [[0.0]])
    assert (plain.sensor_names, plain.actuator_names) == (None, None)
    given = Demonstrations([[1.0, 2.0]], [[0.0]], sensor_names=["left", "right"], actuator_names=["wheel"])
    assert (given.sensor_names, given.actuator_names) == (("left", "right"), ("wheel",))


def test_names_travel_in_files(tmp_path: Path) -> None:
    for shown in (named(), Demonstrations([[1.0, 2.0]], [[0.0]])):
        again = Demonstrations.load(shown.save(tmp_path / "shown"))
        assert (again.sensor_names, again.actuator_names) == (shown.sensor_names, shown.actuator_names)


def test_swapped_columns_are_not_another_robot() -> None:
    sensors = [Sensor("left", 0, 9), Sensor("right", 0, 9)]
    bank = BehaviourBank(Space(Schema(sensors, [Actuator("wheel", 0, 1)]), vsa=MAP(64)))
    bank.learn("steer", named())
    named().check(bank.space.schema)
    swapped = Demonstrations(FRAME[["right", "left"]], FRAME["wheel"])
    for learn in (
        lambda: bank.learn("steer", swapped),
        lambda: bank.partial_fit("steer", swapped, ErrorDriven()),
        lambda: swapped.check(bank.space.schema),
        lambda: swapped.check_names(bank.space.schema),
    ):
        with pytest.raises(
            ValueError, match=r"sensor readings .* order differs; expected left, right; got right, left"
        ):
            learn()
    motor = Demonstrations([[1.0, 2.0]], [[0.0]], actuator_names=["motor"])
    with pytest.raises(ValueError, match=r"commands .* missing: wheel; unknown: motor"):
        bank.learn("steer", motor)


def test_names_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match=r"part 1 has columns with the names .*None.* part 0 .*'left', 'right'"):
        Demonstrations.join([named(), Demonstrations([[1.0, 2.0]], [[0.0]])])
    with pytest.raises(ValueError, match="data frame are not those of sensor_names; their order differs"):
        Demonstrations(FRAME[["left", "right"]], [[0.0]] * 3, sensor_names=["right", "left"])
    for names, words in (
        (["a"], "sensor_names has 1 names for 2 columns"),
        (["a", "a"], "sensor_names: the names of columns must differ"),
        (["a", 1], "sensor_names: the names of columns must all be strings"),
        ("ab", "sensor_names: expected the names"),
    ):
        with pytest.raises(ValueError, match=words):
            Demonstrations([[1.0, 2.0]], [[0.0]], sensor_names=cast(Any, names))


def test_parts_that_cannot_be_joined() -> None:
    with pytest.raises(ValueError, match="no demonstrations to join"):
        Demonstrations.join([])
    with pytest.raises(ShapeError, match="sensors of part 1 has 2 columns, those of part 0 1"):
        Demonstrations.join([Demonstrations([[1.0]], [[0.0]]), Demonstrations([[1.0, 2.0]], [[0.0]])])


@pytest.mark.parametrize(
    "episodes",
    [
        [0.0, math.nan],
        [0.0, math.inf],
        [0, 0.9],
        np.array([0, 0.5]),
        torch.tensor([0.0, 1.5]),
        [True, False],
        torch.tensor([True, False]),
        ["0", "1"],
        [0, None],
        [0, 1j],
        [0, 2**63],
        [0, 2**70],
        [0, 1e300],
    ],
)
def test_episodes_are_whole_numbers(episodes: Any) -> None:
    with pytest.raises(ValueError, match="episodes must be"):
        Demonstrations([[1.0], [2.0]], [[1.0], [1.0]], episodes)


def test_whole_episodes_of_other_types_are_taken() -> None:
    for episodes in ([0.0, 7.0], torch.tensor([0.0, 7.0]), np.array([0, 7], dtype=np.uint64), pd.Series([0, 7])):
        assert Demonstrations([[1.0], [2.0]], [[1.0], [1.0]], episodes).episodes.tolist() == [0, 7]


@pytest.mark.parametrize(
    "keep", [[2, 0, 1], [1, 0, 1], np.array([0, 1]), torch.tensor([1, 0, 1]), slice(2), [], "all", None]
)
def test_rows_are_chosen_by_booleans(keep: Any) -> None:
    shown = Demonstrations([[1.0], [2.0], [3.0]], [[1.0]] * 3)
    with pytest.raises(ValueError, match=r"keep (must be|cannot be)"):
        shown.where(keep)
    for wrong in ([True], [True] * 4, [[True, False, True]]):
        with pytest.raises(ValueError, match=r"keep must be one boolean per row, \[3\]; got shape"):
            shown.where(cast(Any, wrong))
    assert len(shown.where(np.array([True, False, True]).tolist())) == 2
    assert len(shown.where(torch.tensor([True, False, True]))) == 2


def test_one_row_is_written_as_a_batch() -> None:
    with pytest.raises(ShapeError, match=r"got shape \(2,\); write one row as \[row\]"):
        Demonstrations([1.0, 2.0], [[0.0]])


def rewritten(path: Path, change: Callable[[dict[str, torch.Tensor]], Any], about: Any) -> Path:
    tensors = {name: getattr(named(), name) for name in ("sensors", "commands", "episodes")}
    change(tensors)
    return save_tensors(path, "demonstrations", tensors, about)


ABOUT = {"rows": 3, "sensor_names": ["left", "right"], "actuator_names": ["wheel"]}
FIELDS: dict[str, tuple[Callable[[dict[str, torch.Tensor]], Any], Any, str]] = {
    "float32 sensors": (lambda t: t.update(sensors=t["sensors"].float()), ABOUT, "sensors must be of type"),
    "half commands": (lambda t: t.update(commands=t["commands"].half()), ABOUT, "commands must be of type"),
    "episodes of floats": (lambda t: t.update(episodes=t["episodes"].double()), ABOUT, "episodes must be of type"),
    "episodes of bools": (lambda t: t.update(episodes=t["episodes"].bool()), ABOUT, "episodes must be of type"),
    "no dimension": (lambda t: t.update(sensors=t["sensors"].sum()), ABOUT, "sensors has shape"),
    "one dimension": (lambda t: t.update(commands=t["commands"][:, 0]), ABOUT, "commands must be rows"),
    "rows of episodes": (lambda t: t.update(episodes=t["episodes"][:, None]), ABOUT, "episodes must be one number"),
    "fewer commands": (lambda t: t.update(commands=t["commands"][:2]), ABOUT, "commands has 2 rows"),
    "infinite readings": (lambda t: t["sensors"].fill_(math.inf), ABOUT, "sensors has an infinite value"),
    "NaN commands": (lambda t: t["commands"].fill_(math.nan), ABOUT, "commands has nan"),
    "no episodes": (lambda t: t.pop("episodes"), ABOUT, "expected the tensors sensors, commands, episodes"),
    "another tensor": (lambda t: t.update(more=torch.ones(1)), ABOUT, "expected the tensors"),
    "unknown field": (len, ABOUT | {"robot": 1}, "its description must contain only rows"),
    "other rows": (len, {"rows": 4}, "rows is 4"),
    "rows of another type": (len, {"rows": True}, "rows is True"),
    "names of another type": (len, {"rows": 3, "sensor_names": "lr"}, "sensor_names must be a list"),
    "null names": (len, {"rows": 3, "actuator_names": None}, "actuator_names must be a list"),
    "numbers as names": (len, {"rows": 3, "sensor_names": [1, 2]}, "sensor_names: the names"),
    "too few names": (len, {"rows": 3, "sensor_names": ["left"]}, "sensor_names has 1 names for 2 columns"),
    "nested names": (len, {"rows": 3, "sensor_names": [["left"], ["right"]]}, "sensor_names: the names"),
}


@pytest.mark.parametrize("case", FIELDS)
def test_corrupted_files_name_file_and_field(case: str, tmp_path: Path) -> None:
    change, about, words = FIELDS[case]
    path = rewritten(tmp_path / "shown", change, about)
    with pytest.raises(ValueError, match=f"^{path} does not hold demonstrations of this version: .*{words}"):
        Demonstrations.load(path)


@pytest.mark.parametrize("about", [[3], None, "rows", 3])
def test_descriptions_of_another_type(about: Any, tmp_path: Path) -> None:
    path = rewritten(tmp_path / "shown", len, about)
    with pytest.raises(ValueError, match=f"^{path}.* description"):
        Demonstrations.load(path)


def test_a_file_whose_description_is_nested_without_end(tmp_path: Path) -> None:
    path = rewritten(tmp_path / "shown", len, "here")
    content = path.read_bytes()
    start = 8 + int.from_bytes(content[:8], "little")
    header = json.loads(content[8:start])
    for about in ("[" * 100_000 + "]" * 100_000, '{"rows": ' + "1" * 5000 + "}"):
        header["__metadata__"]["torchvsa"] = about
        changed = json.dumps(header).encode()
        path.write_bytes(len(changed).to_bytes(8, "little") + changed + content[start:])
        with pytest.raises(ValueError, match=f"^{path}"):
            Demonstrations.load(path)


def test_files_without_names_still_load(tmp_path: Path) -> None:
    for about in ({"rows": 3}, {}):
        again = Demonstrations.load(rewritten(tmp_path / "shown", len, about))
        assert len(again) == 3
        assert (again.sensor_names, again.actuator_names) == (None, None)
