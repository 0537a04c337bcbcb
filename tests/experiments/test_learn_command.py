"""`torchvsa learn` turns a log into a bank and a page, and compares models by run."""

import io
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

from behaviours import Actuator, BehaviourBank
from behaviours.commands.learn import Learned, learn, options_of
from behaviours.commands.schema_file import read_schema
from behaviours.commands.validate import LEVELS, RIVALS, SMOOTH
from behaviours.data import read_csv
from experiments.main import main
from experiments.own_robot.regions import contradictions, next_demonstrations, runs
from experiments.own_robot.tables import error_format, score_table

RUNS, ROWS = 4, 120


def driven(hidden: bool = False) -> pd.DataFrame:
    """A robot that keeps its distance to a wall, and turns where the way is blocked.

    With `hidden`, where the wall is far it turns to a side that no sensor tells.
    """
    rng = np.random.default_rng(0)
    near, front = rng.uniform(0, 2, (2, RUNS * ROWS)).round(3)
    turn = np.where(front > 0.8, np.clip(2 * (near - 0.5), -1, 1), 1.0)
    if hidden:
        turn = np.where(near > 1.5, rng.choice([-1.0, 1.0], len(near)), turn)
    return pd.DataFrame(
        {
            "run": np.repeat([f"r{k}" for k in range(RUNS)], ROWS),
            "time": np.tile(np.arange(ROWS) * 0.05, RUNS),
            "near [m]": near,
            "front [m]": np.where(rng.random(len(near)) < 0.02, np.nan, front),
            "bumper": (front < 0.1).astype(int),
            "v": np.where(front > 0.8, 0.3, 0.05),
            "omega [rad/s]": turn.round(4),
        }
    )


@pytest.fixture
def log(tmp_path: Path) -> Path:
    driven().to_csv(tmp_path / "log.csv", index=False)
    return tmp_path / "log.csv"


def typed(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """The exit status of `torchvsa learn`, what it prints, and what it says on the side."""
    status = 0
    try:
        main(["learn", *map(str, arguments)])
    except SystemExit as ended:
        status = ended.code if isinstance(ended.code, int) else 0
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def learned(path: Path, *arguments: str) -> Learned:
    return learn(options_of([str(path), "--dim", "500", "--output", str(path.with_suffix(".bank")), *arguments]))


@pytest.mark.slow
def test_a_log_becomes_a_bank_that_answers_and_a_page(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bank = log.with_name("bank.safetensors")
    status, printed, said = typed(
        capsys, log, "--sensors", "near,front", "bumper", "--actuators", "v", "omega", "--by", "run", "--dim", "1000",
        "--output", bank,
    )  # fmt: skip
    assert status == 0
    for model in (LEVELS, SMOOTH, *RIVALS):
        assert model in printed
    assert re.search(r"hold out runs, 4 times: 100%", said)
    assert f"{bank} and {bank.with_suffix('.html')} written" in printed
    behaviour = BehaviourBank.load(bank)["log"]
    assert [sensor.unit for sensor in behaviour.space.schema.sensors] == ["m", "m", ""]
    answer = behaviour([[1.0, 0.4, 0.0], [0.1, 1.5, 0.0]]).commands
    assert answer[:, 1].tolist() == pytest.approx([1.0, -0.8], abs=0.15)
    page = bank.with_suffix(".html").read_text()
    titles = re.findall(r"<h2[^>]*>(.*?)</h2>", page)
    assert [re.sub("<.*?>", "", title).strip() for title in titles] == [
        "Scores", "What to demonstrate next", "Where it errs", "What is unfamiliar", "What contradicts",
        "Dimensions and bins", "Sensors and actuators",
    ]  # fmt: skip
    assert page.count("data:image/png") == 2
    assert "could not be drawn" not in page


def test_scores_are_mean_errors_in_runs_that_were_not_shown(log: Path) -> None:
    found = learned(log, "--actuators", "v,omega", "--by", "run", "--no-page")
    frame = driven()
    rows = {row["model"]: row for row in score_table(found).rows}
    for name, title in (("v", "v"), ("omega", "omega [rad/s]")):
        errors = [
            abs(frame.loc[frame["run"] == run, title] - frame.loc[frame["run"] != run, title].mean())
            for run in frame["run"].unique()
        ]
        assert rows["mean"][name] == pytest.approx(pd.concat(errors).mean())
        by_run = {row["run"]: row[f"mean {name}"] for row in runs(found)}
        assert list(by_run.values()) == pytest.approx([part.mean() for part in errors])
    # Ranges of .25 and 2: the better kind is that with the smaller mean of relative errors.
    relative = {kind: rows[kind]["v"] / 0.25 + rows[kind]["omega"] / 2 for kind in (LEVELS, SMOOTH)}
    assert found.kind == min(relative, key=lambda kind: relative[kind])
    assert rows[found.kind]["omega"] < rows["mean"]["omega"] / 4


@pytest.mark.parametrize(("low", "high", "shown"), [(-1, 1, "0.0123"), (0, 255, "0.01"), (0, 0.004, "0.0123457")])
def test_errors_have_the_decimals_that_their_range_needs(low: float, high: float, shown: str) -> None:
    assert format(0.0123456789, error_format(Actuator("v", low, high))) == shown


def test_commands_of_few_levels_are_classes(log: Path) -> None:
    frame = driven()
    frame.drop(columns="omega [rad/s]").to_csv(log, index=False)
    found = learned(log, "--actuators", "v", "--by", "run", "--no-page")
    assert found.kind == LEVELS
    assert SMOOTH not in found.validation.predicted
    assert found.schema.actuators[0].levels == 2
    assert learned(log, "--actuators", "v", "--by", "run", "--no-page", "--commands", "smooth").kind == SMOOTH


def test_what_no_sensor_tells_is_found(log: Path) -> None:
    driven(hidden=True).to_csv(log, index=False)
    found = learned(log, "--sensors", "near,front", "--actuators", "omega", "--by", "run", "--no-page")
    share, cells = contradictions(found)
    # A quarter of the rows are turned to either side.
    assert 0.08 < share < 0.2
    assert all(float(re.findall(r"near ([\d.]+) to", cell["where"])[0]) > 1.4 for cell in cells[:3])
    first = next_demonstrations(found)[0]
    assert first["where"].startswith("near: 1.")
    assert first["off"] > 2


def test_a_proposed_schema_is_corrected_and_used(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = log.with_name("robot.yaml")
    status, printed, _ = typed(capsys, log, "--actuators", "v", "omega", "--by", "run", "--propose", file)
    assert status == 0
    assert f"--schema {file}" in printed
    text = file.read_text()
    assert "# time: left out, it grows from row to row" in text
    file.write_text(text.replace("- name: bumper\n  kind: binary\n", "").replace("levels: 21", "levels: 5"))
    schema, by = read_schema(file)
    assert [sensor.name for sensor in schema.sensors] == ["near", "front"]
    assert (schema.actuators[1].levels, by) == (5, "run")
    found = learned(log, "--schema", str(file), "--no-page", "--commands", "levels")
    assert found.schema == schema
    commands = BehaviourBank.load(found.options.output)["log"](found.shown.sensors).commands
    assert len(commands[:, 1].unique()) <= 5


def test_without_runs_stretches_of_time_are_held_out(log: Path) -> None:
    found = learned(log, "--sensors", "near", "--actuators", "omega", "--no-page")
    assert found.by is None
    assert found.validation.folds.tolist() == [row * 5 // (RUNS * ROWS) for row in range(RUNS * ROWS)]


def test_the_runs_that_a_format_knows_are_held_out(tmp_path: Path) -> None:
    frame = driven()
    numbers = frame["run"].str.removeprefix("r").astype(int).tolist()
    columns = {"observation.near": frame["near [m]"], "action": frame["omega [rad/s]"]}
    feature = {"dtype": "float64", "shape": [1], "names": None}
    info = {"codebase_version": "v3.0", "fps": 20, "features": dict.fromkeys(columns, feature)}
    folder = tmp_path / "arm"
    for part in ("meta", "data/chunk-000"):
        (folder / part).mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info))
    table = pa.table(columns | {"episode_index": numbers})
    parquet.write_table(table, folder / "data/chunk-000/file-000.parquet")
    found = learned(folder, "--no-page")
    assert found.validation.folds.tolist() == numbers
    assert "runs that it was not shown" in score_table(found).caption
    assert [row["run"] for row in runs(found)] == ["0", "1", "2", "3"]


def test_the_same_seed_learns_the_same_bits(log: Path) -> None:
    files = []
    for seed in ("3", "3", "4"):
        found = learned(log, "--sensors", "near", "--actuators", "v", "--by", "run", "--no-page", "--seed", seed)
        files.append(found.options.output.read_bytes())
    assert files[0] == files[1] != files[2]


def test_names_are_found_whatever_their_order(log: Path) -> None:
    def commands(frame: pd.DataFrame) -> list[float]:
        frame.to_csv(log, index=False)
        options = "--sensors", "near,front", "--actuators", "v,omega", "--by", "run", "--no-page"
        found = learned(log, *options)
        return BehaviourBank.load(found.options.output)["log"]([[0.6, 1.5]]).commands[0].tolist()

    frame = driven()
    assert commands(frame) == commands(frame.iloc[:, ::-1])


BY = ("--actuators", "v,omega", "--by", "run")


@pytest.mark.parametrize(
    ("change", "arguments", "why"),
    [
        (None, ("--actuators", "v", "omga"), "there is no column 'omga'; did you mean 'omega'?"),
        (None, ("--sensors", "nearr", *BY), "there is no column 'nearr'; did you mean 'near'?"),
        (None, ("--actuators", "v", "--by", "ru"), "there is no column 'ru'; did you mean 'run'?"),
        (None, ("--sensors", "v", *BY), "column 'v' cannot be both a sensor and an actuator"),
        (None, (), "which columns are commands?"),
        (None, (*BY, "--output", "nowhere/bank.safetensors"), "cannot write nowhere/bank.safetensors"),
        (None, (*BY, "--dim", "0"), "--dim"),
        (None, (*BY, "--commands", "soft"), "invalid choice: 'soft'"),
        (None, ("--schema", "robot.yaml", "--sensors", "near"), "leave out --sensors"),
        (None, ("--schema", "robot.yaml"), "robot.yaml"),
        (("r1", "r0"), BY, "names one run only"),
        (("0.3", "fast"), BY, "fast"),
        ("", BY, "is empty"),
        ("near,v\n", BY, "has no rows"),
        ("near,v\n1,2\n1,2,3\n", BY, "Expected 2 columns, got 3"),
    ],
)
def test_mistakes_take_one_line_and_nothing_is_written(
    log: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    change: str | tuple[str, str] | None, arguments: tuple[str, ...], why: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(log.parent)
    if isinstance(change, str):
        log.write_text(change)
    elif change is not None:
        old, new = change
        frame = driven().astype(str)
        frame = frame.replace(r"r\d", "r0", regex=True) if old == "r1" else frame
        if old != "r1":
            frame.loc[5, "near [m]"] = new
        frame.to_csv(log, index=False)
    status, printed, said = typed(capsys, log, *arguments)
    assert status == 1
    assert printed == ""
    assert said.count("\n") == 1
    assert why in said
    assert sorted(path.name for path in log.parent.iterdir()) == ["log.csv"]


def test_the_log_is_never_overwritten(log: Path) -> None:
    with pytest.raises(ValueError, match="is the log itself"):
        options_of([str(log), "--output", str(log)])
    with pytest.raises(ValueError, match="is the log itself"):
        options_of([str(log), "--propose", str(log)])


def test_a_large_log_is_validated_with_a_part_of_it(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("behaviours.commands.learn.VALIDATED", 100)
    monkeypatch.setattr("behaviours.commands.validate._SMOOTH_ROWS", 200)
    options = "--sensors", "near", "--actuators", "omega", "--by", "run", "--no-page", "--commands", "smooth"
    found = learned(log, *options)
    assert len(found.validation.shown) == 100
    assert len(found.shown) == RUNS * ROWS
    assert found.report.samples == 200
    assert any("200 rows, evenly spread" in note for note in found.notes)


def test_progress_is_a_line_for_each_tenth_in_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    from experiments.own_robot.command import shown_progress

    said = io.StringIO()
    monkeypatch.setattr(sys, "stderr", said)
    show = shown_progress("work")
    for step in range(101):
        show(step / 100)
    assert [line.split(",")[0] for line in said.getvalue().splitlines()] == [f"work: {k / 10:4.0%}" for k in range(11)]


def test_the_columns_of_the_log_are_those_of_the_table(log: Path) -> None:
    found = replace(learned(log, *BY, "--no-page"), by=None)
    assert [column.key for column in score_table(found).columns] == [
        "model", "v", "omega", "v agreement", "omega agreement",
    ]  # fmt: skip
    assert read_csv(log).columns == ["run", "time", "near", "front", "bumper", "v", "omega"]
