"""The capacity study: pairs are counted as the printed algorithms answer, and the search finds what there is."""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow.parquet as pq
import pytest
from commands import only, results, shared_output_of
from kits import composed

from experiments.capacity.study import Capacity, made, measure, study
from experiments.kit.run import check_all
from experiments.main import main
from experiments.tasks.random_pairs import CONDITIONS, bracket, expected, halve, predicted, random_pairs, recalled


def settings(*overrides: str) -> Capacity:
    return cast(Capacity, composed(study, *overrides))


@pytest.fixture
def oracle(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Algorithms 1 and 2, as the tests of the behaviours transcribe them."""
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "behaviours")
    return importlib.import_module("oracle")


def test_the_pairs_are_distinct_and_fewer_are_the_first_of_more() -> None:
    few, more = random_pairs(50, 3), random_pairs(CONDITIONS, 3)
    assert len(more.sensors.unique(dim=0)) == CONDITIONS == 8000
    assert len(more.commands.unique(dim=0)) == 9
    assert (few.sensors == more.sensors[:50]).all()
    assert (few.commands == more.commands[:50]).all()
    assert not (random_pairs(50, 4).sensors == few.sensors).all()
    with pytest.raises(ValueError, match="8000 different conditions; 8001"):
        random_pairs(CONDITIONS + 1, 0)


@pytest.mark.parametrize(("row", "clip"), [("literal", True), ("OneShot_mean", False), ("OneShot_sum", False)])
def test_recall_is_counted_as_the_printed_algorithms_answer(oracle: Any, row: str, clip: bool) -> None:
    shown = random_pairs(40, 7)
    rule, space = made(settings(), row, 300, 7)
    encoder = oracle.Encoder.of(space)
    sensors, commands = shown.sensors.tolist(), shown.commands.tolist()
    learned = oracle.learn(encoder, sensors, commands, clip_each_step=clip)
    right = [
        oracle.query(encoder, learned, asked).commands == wanted
        for asked, wanted in zip(sensors, commands, strict=True)
    ]
    share = recalled(rule.fit(space, shown), shown)
    assert share == np.mean(right)
    assert 0.1 < share < 1


def test_a_measurement_reports_what_it_asked() -> None:
    config = settings("dims=[64,128]", "pairs=[4,8,16,32]", "precision=0.0")
    rows = measure(config, {"learner": "OneShot_sum", "dim": 128, "repeat": 1})
    found = rows[0]["held"]
    shares = {row["pairs"]: row["recall"] for row in rows}
    assert len(shares) == len(rows)
    assert {4, 8, 16} <= set(shares)
    assert shares[found] >= 0.99
    assert shares[found + 1] < 0.99
    seed = int(np.random.SeedSequence([0, 1]).generate_state(1)[0])
    rule, space = made(config, "OneShot_sum", 128, seed)
    shown = random_pairs(found + 1, seed)
    assert recalled(rule.fit(space, shown), shown) == shares[found + 1]
    # With a smaller dimension the search begins from the guess.
    rows = measure(config, {"learner": "OneShot_sum", "dim": 64, "repeat": 1})
    assert rows[0]["held"] < found
    assert rows[0]["pairs"] == 1


def test_a_curve_ends_where_little_is_left() -> None:
    config = settings("dims=[64]", "pairs=[200,2,400,100]", "until=0.7")
    rows = measure(config, {"learner": "OneShot_sum", "dim": 64, "repeat": 0})
    asked = [row["pairs"] for row in rows]
    assert asked[:2] == [2, 100]
    assert 200 not in asked
    assert 2 <= rows[0]["held"] < 100


def up_to(limit: int, asked: list[int]) -> Callable[[int], bool]:
    def holds(count: int) -> bool:
        assert count not in asked, "asked twice"
        asked.append(count)
        return count <= limit

    return holds


@pytest.mark.parametrize("limit", [0, 1, 2, 17, 400, 999, 1000, 5000])
@pytest.mark.parametrize("start", [0, 1, 16, 390, 1000, 3000])
@pytest.mark.parametrize("precision", [0.0, 0.03])
def test_the_search_finds_the_limit_of_a_known_curve(limit: int, start: int, precision: float) -> None:
    for low in (0, min(limit, 16)):
        asked: list[int] = []
        holds = up_to(limit, asked)
        found = halve(holds, *bracket(holds, start, low, 1001), precision)
        exact = min(limit, 1000)
        assert found <= exact <= found + max(1, precision * found)
        assert found == exact or precision > 0
        assert all(low < count < 1001 for count in asked)


def test_the_closed_form_is_that_of_a_raw_sum() -> None:
    """Averaged over six draws of 60 pairs at d = 700: a standard error of about .009."""
    shares = []
    for seed in range(6):
        rule, space = made(settings(), "OneShot_sum", 700, seed)
        shown = random_pairs(60, seed)
        shares.append(recalled(rule.fit(space, shown), shown))
    assert np.mean(shares) == pytest.approx(expected(700, 60), abs=0.03)
    assert expected(700, 60) < 0.95
    held = predicted(4000, 0.99)
    assert expected(4000, held) >= 0.99 > expected(4000, held + 1)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("rows=[nobody]", "rows: there is no 'nobody'; choose from literal, "),
        ("rows=[]", "rows is empty"),
        ("dims=[100,100]", "dims names 100 2 times"),
        ("dims=[0]", r"dims=\[0\]: expected 1 or more"),
        ("dims=[100,2000000000]", "of memory"),
        ("dims=[[1]]", r"dims=\[\[1\]\]: expected a list without lists"),
        ("pairs=[9000]", r"pairs=\[9000\]: expected a number from 1 to 8000"),
        ("accuracy=1.0", "accuracy=1: expected more than 0 and less than 1"),
        ("learners.Gradient.codes.record=secret", "no encoder 'secret'"),
        ("learners.Gradient.rule.name=guess", "no learning rule 'guess'"),
        ("vsa=hrr", "the rule least_squares cannot train programs of HRR"),
    ],
)
def test_wrong_settings_are_named(override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, settings(override))


TINY = (
    "dims=[60,120]",
    "pairs=[4,30,60]",
    "repeats=2",
    "rows=[literal,OneShot_sum,Gradient]",
    "learners.Gradient.rule.epochs=40",
    "workers=1",
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("capacity")
    return folder, shared_output_of(folder, "capacity", *TINY)


def test_the_command_writes_table_records_and_page(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    content = results(folder)
    records = pq.read_table(only(folder, "records.parquet")).to_pylist()
    rows = {(row["learner"], row["dim"]): row for row in content["table"]}
    assert list(rows) == [
        (learner, dim) for learner in ("literal", "OneShot_sum", "Gradient", "closed_form") for dim in (60, 120)
    ]
    for (learner, dim), row in rows.items():
        name = f"{learner}.{dim}.pairs"
        assert content["metrics"][name] == row["pairs"]
        if learner == "closed_form":
            assert row["pairs"] == predicted(dim, 0.99)
            continue
        own = [record for record in records if (record["learner"], record["dim"]) == (learner, dim)]
        best = [
            max([r["pairs"] for r in own if r["repeat"] == repeat and r["recall"] >= 0.99], default=0)
            for repeat in range(2)
        ]
        assert row["pairs_min"] <= row["pairs"] == np.mean([row["pairs_min"], row["pairs_max"]]) <= max(best)
    assert rows["Gradient", 120]["pairs"] > 2 * rows["OneShot_sum", 120]["pairs"] > 0
    assert rows["Gradient", 120]["pairs"] > rows["Gradient", 60]["pairs"]
    shares = [r["recall"] for r in records if (r["learner"], r["dim"], r["pairs"]) == ("Gradient", 120, 30)]
    assert content["metrics"]["Gradient.120.recall_of_30"] == np.median(shares)
    assert "closed_form" in printed
    assert only(folder, "report.html").read_text().count("data:image/png;base64,") == 1
    assert only(folder, "capacity.png").read_bytes().startswith(b"\x89PNG")


def test_a_wrong_setting_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")  # which the command changes
    with pytest.raises(SystemExit) as exit_:
        main(["capacity", "rows=[nobody]"])
    assert exit_.value.code == 1
    error = capsys.readouterr().err
    assert error.startswith("capacity: rows: there is no 'nobody'; choose from literal, ")
    assert error.count("\n") == 1
    assert not list(tmp_path.rglob("results.json"))


@pytest.mark.parametrize("value", ["1e30", "text", "[1,1]"])
def test_settings_that_hold_settings_take_no_value(
    value: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    with pytest.raises(SystemExit):
        main(["capacity", f"learners={value}"])
    assert "learners: it holds settings; write learners.setting=value" in capsys.readouterr().err
