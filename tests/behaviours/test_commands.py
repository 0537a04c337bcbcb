"""`torchvsa ask` answers a pipe line by line, and `torchvsa show` describes files."""

import io
import math
from pathlib import Path

import pytest

from behaviours import Actuator, BehaviourBank, Demonstrations, LeastSquares, Schema, Sensor, Space
from behaviours.commands.ask import MEASURES, ask
from behaviours.commands.show import show

SCHEMA = Schema(
    [Sensor("front", 0, 4, unit="m"), Sensor("gear", kind="categorical", values=("low", "high"))],
    [Actuator("speed", -1, 1, levels=3), Actuator("turn", -1, 1, unit="rad/s", levels=3)],
)
ROWS = [[3.0, "high"], [0.5, "low"], [0.1, "low"], [2.0, "high"]]
COMMANDS = [[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0], [1.0, 1.0]]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    bank = BehaviourBank(Space(SCHEMA))
    bank.learn("drive", Demonstrations(ROWS, COMMANDS, schema=SCHEMA))
    return bank.save(tmp_path / "bank.safetensors")


def asked(path: Path, *lines: str, name: str | None = None) -> tuple[list[list[str]], list[str], int]:
    """The fields of all lines, what was said on the side, and how many rows failed."""
    out, problems = io.StringIO(), io.StringIO()
    failed = ask(path, name, (line + "\n" for line in lines), out, problems)
    return [line.split(",") for line in out.getvalue().splitlines()], problems.getvalue().splitlines(), failed


def test_answers_are_those_of_the_behaviour_whatever_the_order_of_columns(path: Path) -> None:
    lines = [f"{gear},ignored,{front}" for front, gear in ROWS]
    (head, *answers), problems, failed = asked(path, "gear,note,front", *lines)
    assert head == ["speed", "turn", *MEASURES]
    assert [[float(field) for field in row[:2]] for row in answers] == COMMANDS
    recall = BehaviourBank.load(path)["drive"](ROWS)
    for row, *measures in zip(answers, *(getattr(recall, name).tolist() for name in MEASURES), strict=True):
        assert [float(field) for field in row[2:]] == pytest.approx(measures, abs=1e-5)
    assert (problems, failed) == ([], 0)


def test_an_empty_field_is_not_observed(path: Path) -> None:
    (_, partly, blind), problems, _ = asked(path, "front,gear", "0.1,", ",")
    expected = BehaviourBank.load(path)["drive"]([[0.1, math.nan]])
    assert [float(field) for field in partly[:2]] == expected.commands[0].tolist()
    assert blind[:2] == ["", ""]
    assert problems == []


@pytest.mark.parametrize(
    ("row", "why"),
    [
        ("abc,low", "row 1: sensor 'front': expected a number; got 'abc'"),
        ("1.0,middle", "row 1: sensor 'gear': expected one of low, high; got 'middle'"),
        ("1.0", "row 1: sensor 'gear': the row has only 1 fields"),
        ("9.0,low", "row 1: sensor 'front' reads 9"),
    ],
)
def test_a_row_that_cannot_be_answered_is_named_and_the_next_one_is_answered(path: Path, row: str, why: str) -> None:
    (_, empty, answered), problems, failed = asked(path, "front,gear", row, "3.0,high")
    assert empty == [""] * 5
    assert answered[0] == "1"
    assert len(problems) == failed == 1
    assert problems[0].startswith(why)


def test_each_line_is_answered_before_the_next_is_read(path: Path) -> None:
    out, seen = io.StringIO(), []

    def lines():  # type: ignore[no-untyped-def] (a generator of text)
        for line in ("front,gear", "3.0,high", "0.5,low"):
            seen.append(out.getvalue().count("\n"))
            yield line + "\n"

    ask(path, None, lines(), out, io.StringIO())
    assert seen == [0, 1, 2]


@pytest.mark.parametrize(
    ("header", "name", "why"),
    [
        ("front,speed", None, "there is no column for gear; the header has front, speed"),
        ("front,gear", "fly", "there is no behaviour 'fly'; the bank has drive"),
        ("front,front,gear", None, "front"),
    ],
)
def test_what_cannot_work_is_said_at_once(path: Path, header: str, name: str | None, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        asked(path, header, "1,low", name=name)
    with pytest.raises(ValueError, match="there is no header"):
        asked(path)


def test_a_bank_of_several_asks_which(path: Path) -> None:
    bank = BehaviourBank.load(path)
    bank.add("again", bank["drive"])
    bank.save(path)
    with pytest.raises(ValueError, match="which behaviour\\? the bank has drive, again"):
        asked(path, "front,gear")


def test_files_are_described(path: Path, tmp_path: Path) -> None:
    told = show(path)
    for part in (
        "bank of 1 behaviour over MAP-C(dim=4000, dtype=int8)",
        "front: 0 to 4 m, real",
        "gear: one of low, high, categorical",
        "turn: -1 to 1 rad/s, 3 levels",
        "drive: 4 pairs by",
        " results",
    ):
        assert part in told
    smooth = BehaviourBank.load(path)
    smooth.learn("smoothly", Demonstrations(ROWS, COMMANDS, schema=SCHEMA), LeastSquares(smooth=True))
    assert "behaviour   smoothly: 4 pairs by least_squares, smooth commands" in show(smooth.save(tmp_path / "smooth"))
    shown = Demonstrations([[1.0, math.nan], [2.0, 3.0]], [[0.5], [1]], [0, 1], sensor_names=["a", "b"])
    told = show(shown.save(tmp_path / "shown.safetensors"))
    assert told.splitlines() == [
        "demonstrations of 2 rows in 2 episodes",
        "sensor      a: 1 to 2",
        "sensor      b: 3 to 3, 1 not observed",
        "command     number 0: 0.5 to 1",
    ]
    (tmp_path / "other").write_text("text")
    with pytest.raises(ValueError, match="other"):
        show(tmp_path / "other")
