"""`torchvsa collect`: everything that runs left is gathered, what is missing is named, and differences are paired."""

import io
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from commands import output_of
from counting import study
from kits import composed
from rich.console import Console
from scipy import stats

from experiments.collecting.command import collect
from experiments.kit import STUDIES
from experiments.kit.intervals import bootstrap, bootstrap_nested
from experiments.kit.run import run
from experiments.main import main

MEMORIES = ("dim=40,60", "items=[30]", "noise=[0.3,0.4]", "memories=[clean_up]", "queries=20", "repeats=6", "workers=1")


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep of four jobs of a real study."""
    folder = tmp_path_factory.mktemp("swept")
    output_of(folder, "memories", "--multirun", "seed=0,1", *MEMORIES)
    return folder / "outputs" / "memories" / "sweep"


@pytest.fixture
def copied(swept: Path, tmp_path: Path) -> Path:
    shutil.copytree(swept, tmp_path / "sweep")
    return tmp_path / "sweep"


def count(folder: Path, *overrides: str, **changed: Any) -> Path:
    """The folder of a run of the study that counts; it may fail."""
    settings = replace(composed(study, "workers=1", *overrides), drawable=False, **changed)
    try:
        run(study, settings, folder, Console(quiet=True))
    except RuntimeError:
        assert changed
    return folder


@pytest.fixture
def counted(tmp_path: Path) -> Callable[..., Path]:
    """`counted(name, *overrides, **changed)` counts in a folder of that name."""
    return lambda name, *overrides, **changed: count(tmp_path / "runs" / name, *overrides, **changed)


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs and one that failed, and a folder without any."""
    folder = tmp_path_factory.mktemp("three")
    (folder / "empty").mkdir()
    count(folder / "runs" / "a")
    count(folder / "runs" / "b", "share=0.3")
    count(folder / "runs" / "failed", fail_at=1)
    return folder


def collected(*arguments: str | Path) -> tuple[str, Path]:
    """What is printed, and the folder of the results."""
    printed = io.StringIO()
    to = collect([str(argument) for argument in arguments], STUDIES.find, Console(file=printed, width=250))
    return printed.getvalue(), to


def rows_of(printed: str) -> list[list[str]]:
    """The cells of all rows of all tables."""
    lines = [line for line in printed.splitlines() if line.startswith("│")]
    return [[cell.strip() for cell in line.split("│")[1:-1]] for line in lines]


def records_of(sweep: Path, dim: int, seed: int) -> pd.DataFrame:
    for path in sweep.rglob("results.json"):
        config = json.loads(path.read_text())["config"]
        if (config["dim"], config["seed"]) == (dim, seed):
            return pd.read_parquet(path.with_name("records.parquet"))
    raise AssertionError("there is no such run")


def test_all_rows_with_the_settings_that_differ(swept: Path, tmp_path: Path) -> None:
    printed, to = collected(swept, "--to", tmp_path / "to")
    frame = pd.read_parquet(to / "rows.parquet")
    assert list(frame.columns[:4]) == ["run", "study", "config.seed", "config.dim"]
    assert len(frame) == 4 * 6 * 2
    for dim, seed in ((40, 0), (40, 1), (60, 0), (60, 1)):
        own = frame.loc[(frame["config.dim"] == dim) & (frame["config.seed"] == seed)].reset_index(drop=True)
        expected = records_of(swept, dim, seed)
        pd.testing.assert_frame_equal(own.loc[:, list(expected.columns)], expected)
    assert "4 of 4 runs that were found have finished" in printed
    assert "What is missing" not in printed
    page = (to / "report.html").read_text()
    assert "Runs of memories" in page
    # Each run's table, with the same numbers as its results.
    _, to = collected(swept, "--to", tmp_path / "table", "--rows", "table")
    frame = pd.read_parquet(to / "rows.parquet")
    for path in swept.rglob("results.json"):
        own = frame.loc[frame.run == path.parent.name]
        assert own.accuracy.tolist() == [row["accuracy"] for row in json.loads(path.read_text())["table"]]


def test_collecting_again_gives_the_same_bytes_and_gathers_nothing_of_its_own(copied: Path) -> None:
    _, to = collected(copied)
    assert to == copied / "collected"
    first = {path.name: path.read_bytes() for path in to.iterdir() if path.is_file()}
    printed, _ = collected(copied)
    assert "4 of 4 runs" in printed
    assert {path.name: path.read_bytes() for path in to.iterdir() if path.is_file()} == first


def test_two_runs_are_compared_in_pairs(swept: Path, tmp_path: Path) -> None:
    names = sorted(path.parent.name for path in swept.rglob("results.json") if "seed=0" in path.parent.name)
    a, b = records_of(swept, 40, 0), records_of(swept, 60, 0)
    printed, to = collected(swept, "--to", tmp_path, "--compare", *names)
    both = a.merge(b, on=["memory", "items", "repeat", "noise"], suffixes=("", "_other"))
    assert [row for row in rows_of(printed) if len(row) == 3] == [["dim", "40", "60"]]
    lines = [row for row in rows_of(printed) if "accuracy" in row]
    for noise, cells in zip((0.3, 0.4), lines, strict=True):
        own = both.loc[both.noise == noise]
        difference = (own.accuracy_other - own.accuracy).to_numpy()
        assert cells[4:6] == [f"{own.accuracy.mean():.4g}", f"{own.accuracy_other.mean():.4g}"]
        shown = [float(number) for number in cells[6].replace("[", "").replace("]", "").replace(",", "").split()]
        oracle = stats.bootstrap((difference,), np.mean, method="percentile", rng=np.random.default_rng(5))
        low, high = oracle.confidence_interval
        assert shown == pytest.approx([difference.mean(), low, high], abs=0.25 * (high - low))
        assert cells[7:] == ["6", "higher" if shown[1] > 0 else "not told apart"]
    assert "each cell or start that both measured gives one difference" in (to / "report.html").read_text()


def test_two_values_of_a_setting_are_compared_over_all_runs_that_are_alike_otherwise(copied: Path) -> None:
    (alone,) = [path.parent for path in copied.rglob("results.json") if "dim=60" in str(path) and "seed=1" in str(path)]
    printed, _ = collected(copied, "--by", "dim")
    accuracy = next(row for row in rows_of(printed) if "accuracy" in row)
    expected = [
        np.mean([frame.loc[frame.noise == 0.3, "accuracy"].mean() for frame in frames])
        for frames in [[records_of(copied, dim, seed) for seed in (0, 1)] for dim in (40, 60)]
    ]
    assert accuracy[4:6] == [f"{mean:.4g}" for mean in expected]
    assert accuracy[7] == "12"
    shutil.rmtree(alone)
    printed, _ = collected(copied, "--by", "dim=60,40")
    assert next(row for row in rows_of(printed) if "accuracy" in row)[7] == "6"
    assert "Without a partner, and so left out" in printed
    assert "not begun" in printed


def test_without_common_cells_nothing_is_marked(counted: Callable[..., Path]) -> None:
    counted("a", "names=[a]")
    counted("b", "names=[b]", "repeats=3")
    printed, _ = collected(counted("a", "names=[a]").parent, "--compare", "a", "b")
    assert "No cell or start is common to both" in printed
    assert "higher" not in printed
    assert ["names", "[a]", "[b]"] in rows_of(printed)
    assert ["most", "2", "3", "+1"] in rows_of(printed)


def test_what_is_missing_is_named(counted: Callable[..., Path]) -> None:
    runs = counted("whole").parent
    counted("failed", fail_at=1)
    stopped = counted("stopped", "share=0.3")
    (stopped / "results.json").unlink()
    lines = (stopped / "cells.jsonl").read_text().splitlines(keepends=True)
    (stopped / "cells.jsonl").write_text("".join(lines[:2]) + lines[2][:20])
    (counted("damaged", "share=0.4") / "records.parquet").write_bytes(b"PAR1")
    (counted("torn", "share=0.6") / "results.json").write_text('{"study": ')
    counted("other", "share=0.7")
    other = json.loads((runs / "other" / "run.json").read_text())
    (runs / "other" / "run.json").write_text(json.dumps({**other, "version": "0.0.1"}))
    (counted("old", "share=0.8") / "run.json").unlink()
    (runs / "old" / "results.json").unlink()
    shutil.copytree(runs / "whole", runs / "whole_again")
    printed, to = collected(runs)
    lines = [line.split(": ", 2) for line in printed.splitlines() if line.count(": ") > 1]
    table = {name: rest for name, *rest in lines}
    assert table == {
        "damaged": ["damaged", table["damaged"][1]],
        "failed": [
            "failed",
            "1 of 4 cells were measured; RuntimeError: this cell cannot be measured; missing: a/1, b/0, b/1",
        ],
        "old": ["unfinished", "4 cells were measured; how many there are is not known"],
        "other": [
            "unfinished",
            "results.json is of other settings, or of another version; 0 of 4 cells were measured; "
            "stopped, or still running; missing: a/0, a/1, b/0, b/1",
        ],
        "stopped": [
            "unfinished",
            "2 of 4 cells were measured; stopped, or still running; missing: b/0, b/1",
        ],
        "torn": ["damaged", table["torn"][1]],
        "whole_again": ["twice", "the same settings as whole; both are kept"],
    }
    assert table["damaged"][1].startswith("records.parquet cannot be read")
    assert "results.json is not JSON" in table["torn"][1]
    assert set(pd.read_parquet(to / "rows.parquet").run) == {"whole", "whole_again"}
    assert "2 of 8 runs that were found have finished" in printed
    # The same settings once more, and nothing is missing there.
    counted("stopped", "share=0.3")
    assert "3 of 8 runs" in collected(runs)[0]


def test_a_study_that_is_not_installed_is_gathered_all_the_same(counted: Callable[..., Path]) -> None:
    folder = counted("one")
    for name in ("results.json", "run.json"):
        path = folder / name
        path.write_text(path.read_text().replace('"study": "counting"', '"study": "elsewhere"'))
    printed, to = collected(folder.parent)
    assert "Runs of elsewhere" in printed
    assert pd.read_parquet(to / "rows.parquet")["count"].tolist() == [1, 2, 1, 2]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("", "required: folder"),
        ("nowhere", "there is no folder nowhere"),
        ("empty", "empty holds no run"),
        ("runs --nonsense", "unrecognized arguments: --nonsense"),
        ("runs --compare a", "expected 2 arguments"),
        ("runs --compare a zzz", "--compare zzz: there is no folder zzz"),
        ("runs --compare a empty", "is not the folder of a run"),
        ("runs --compare a failed", "this run is failed: 1 of 4 cells were measured"),
        ("runs --by shar", "the runs have no such setting; did you mean share?"),
        ("runs --by share=0.5,0.9", "--by share=A,B; the runs have 0.5, 0.3"),
        ("runs --by seed", "the runs have 0"),
        ("runs --by share --compare a b", "not allowed with"),
    ],
)
def test_one_line_says_what_is_wrong(
    three: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: str, words: str
) -> None:
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    monkeypatch.chdir(three)
    with pytest.raises(SystemExit) as exit_:
        main(["collect", *arguments.split()])
    assert exit_.value.code == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("torchvsa collect: ")
    assert words in line


def test_the_interval_over_runs_and_starts() -> None:
    generator = np.random.default_rng(3)
    one = generator.normal(1, 2, 40).tolist()
    assert bootstrap_nested([one]) == bootstrap(one)
    assert bootstrap_nested([[value] for value in one]) == bootstrap(one)
    # Where runs differ much and their starts little, the runs alone decide: the mean of three of three values.
    runs = [[0.0, 0.0], [3.0, 3.0], [9.0, 9.0]]
    assert bootstrap_nested(runs) == (0.0, 9.0)
    assert bootstrap_nested(runs, drawn=False) == (4.0, 4.0)
    # Where all runs are alike, it is about as wide as over all of their starts together.
    alike = generator.normal(0, 1, (30, 50))
    low, high = bootstrap_nested(alike.tolist())
    both = np.sqrt(alike.var() / alike.size + alike.mean(axis=1).var() / len(alike))
    assert (high - low) / 2 == pytest.approx(1.96 * both, rel=0.1)
    low, high = bootstrap_nested(alike.tolist(), drawn=False)
    assert (high - low) / 2 == pytest.approx(1.96 * np.sqrt(alike.var(axis=1).mean() / alike.size), rel=0.1)
    with pytest.raises(ValueError, match="at least one value in each sample"):
        bootstrap_nested([[1.0], []])
