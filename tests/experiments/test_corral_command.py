"""The main job, run as a user would run it."""

import re
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import torch
from commands import SMALL, only, output_of, results, without_timings

from behaviours import BehaviourBank, Demonstrations
from experiments.corral import COLUMNS
from experiments.results import collect

ROWS = "controllers=[teacher,default,paper,paper_best_bins,bundled,hand_written,nearest_neighbour,random]"


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A small run of most rows: its folder and what the terminal showed."""
    folder = tmp_path_factory.mktemp("run")
    return folder, output_of(folder, *SMALL, ROWS, "paper_bins=[2]")


@pytest.mark.slow
def test_the_table_has_the_promised_rows_and_columns(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    content = results(folder)
    assert [row["controller"] for row in content["table"]] == content["config"]["controllers"]
    assert all(tuple(row) == COLUMNS for row in content["table"])
    for row in content["table"]:
        line = re.search(rf"│ {row['controller']} +│ +{row['episodes']} │.*", printed)
        assert line, row
        time = row["time_to_light_s"]
        assert line[0].split("│")[5].strip() == ("-" if time is None else f"{time:.1f}")
    rows = {row["controller"]: row for row in content["table"]}
    assert rows["teacher"]["heldout_agreement"] == rows["hand_written"]["heldout_agreement"] == 1.0
    assert rows["default"]["train_agreement"] >= 0.999
    assert rows["random"]["heldout_agreement"] < 0.3
    assert rows["default"]["bins"] == rows["paper"]["bins"] == rows["bundled"]["bins"] == 32
    assert rows["hand_written"]["pairs_stored"] == 5


@pytest.mark.slow
def test_the_table_is_what_the_records_say(finished: tuple[Path, str]) -> None:
    folder, _ = finished
    records = pq.read_table(only(folder, "records.parquet")).to_pylist()
    for row in results(folder)["table"]:
        own = [record for record in records if record["controller"] == row["controller"]]
        assert len(own) == row["episodes"]
        assert row["success_rate"] == pytest.approx(np.mean([record["success"] for record in own]))
        assert row["escape_rate"] == pytest.approx(np.mean([record["escaped"] for record in own]))
        assert results(folder)["metrics"][f"{row['controller']}.success_rate"] == row["success_rate"]


@pytest.mark.slow
def test_all_controllers_meet_the_same_starts(finished: tuple[Path, str]) -> None:
    records = pq.read_table(only(finished[0], "records.parquet")).to_pylist()
    starts: dict[int, set[tuple[float, ...]]] = {}
    for record in records:
        start = tuple(record[f"start_{axis}"] for axis in ("x", "y", "heading"))
        starts.setdefault(record["episode"], set()).add(start)
    assert all(len(poses) == 1 for poses in starts.values())
    assert len({next(iter(poses)) for poses in starts.values()}) == 6


@pytest.mark.slow
def test_the_page_and_the_animation_are_there(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    page = only(folder, "report.html")
    assert page.name in printed
    text = page.read_text()
    assert all(row["controller"] in text for row in results(folder)["table"])
    assert "data:image/gif;base64," in text


@pytest.mark.slow
def test_the_same_seed_gives_the_same_results_whatever_the_workers(tmp_path: Path) -> None:
    contents = []
    for name, options in (("a", ("workers=1", "robots=4")), ("b", ("workers=2", "robots=64"))):
        (tmp_path / name).mkdir()
        output_of(tmp_path / name, *SMALL, *options, "controllers=[teacher,default,bundled,random]", "animate=false")
        contents.append(without_timings(results(tmp_path / name), "workers", "robots"))
    assert contents[0] == contents[1]


@pytest.mark.slow
def test_a_sweep_of_two_jobs_is_collected_and_not_run_twice(tmp_path: Path) -> None:
    sweep = (
        "--multirun",
        "vsa.dim=500,1000",
        "hydra.sweep.dir=sweep",
        "controllers=[default]",
        "animate=false",
        *SMALL,
    )
    output_of(tmp_path, *sweep)
    jobs = collect(tmp_path / "sweep")
    assert [job["config"]["vsa"]["dim"] for job in jobs] == [500, 1000]
    times = [path.stat().st_mtime_ns for path in sorted(tmp_path.rglob("results.json"))]
    again = output_of(tmp_path, *sweep)
    assert again.count("nothing to do") == 2
    assert times == [path.stat().st_mtime_ns for path in sorted(tmp_path.rglob("results.json"))]


@pytest.mark.slow
def test_what_was_learned_is_kept_and_can_be_learned_again(finished: tuple[Path, str], tmp_path: Path) -> None:
    folder, _ = finished
    bank = BehaviourBank.load(only(folder, "behaviours.safetensors"))
    assert bank.names == ["default", "seek_light", "avoid", "cruise"]
    shown = only(folder, "demonstrations.safetensors")
    demonstrations = Demonstrations.load(shown)
    assert len(demonstrations.episodes.unique()) == 6
    output_of(tmp_path, *SMALL, f"demonstrations_file={shown}", "controllers=[default]", "animate=false")
    again = BehaviourBank.load(only(tmp_path, "behaviours.safetensors"))
    assert torch.equal(again["default"].program, bank["default"].program)
    agreed = bank["default"](demonstrations.sensors).commands == demonstrations.commands
    assert agreed.all(-1).double().mean() > 0.95
