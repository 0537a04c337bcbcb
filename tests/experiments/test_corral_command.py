"""The main job, run as a user would run it."""

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import torch
from commands import only, output_of, results, shared_output_of
from small_run import full_run, settings, small_run

from behaviours import BehaviourBank, Demonstrations
from experiments.corral import study
from experiments.corral.tables import NUMBERS
from experiments.kit import Outcome, Row

SMALL = (
    "demonstrations=6", "starts=6", "other_starts=4", "wheeled_starts=2", "validation_starts=2", "seconds=20",
    "vsa.dim=1000",
)  # fmt: skip
"""A job of seconds instead of minutes; what it shows is not meant to be good."""
ROWS = "controllers=[teacher,default,paper,paper_best_bins,bundled,hand_written,nearest_neighbour,random]"


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A small run of most rows: its folder and what the terminal showed."""
    folder = tmp_path_factory.mktemp("run")
    return folder, shared_output_of(folder, "corral", *SMALL, ROWS, "paper_bins=[2]", "workers=1")


def episodes(folder: Path) -> list[Row]:
    records = pq.read_table(only(folder, "records.parquet")).to_pylist()
    return [record for record in records if record["kind"] == "episode"]


@pytest.mark.slow
def test_the_table_has_the_promised_rows_and_columns(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    content = results(folder)
    assert [row["controller"] for row in content["table"]] == content["config"]["controllers"]
    assert all({"controller", "common_episodes", *NUMBERS} <= set(row) for row in content["table"])
    for row in content["table"]:
        line = re.search(rf"│ {row['controller']} +│ +{row['episodes']} │.*", printed)
        assert line, row
        time = row["time_to_light_s"]
        assert line[0].split("│")[6].strip() == ("-" if time is None else f"{time:.1f}")
    rows = {row["controller"]: row for row in content["table"]}
    assert rows["teacher"]["heldout_agreement"] == rows["hand_written"]["heldout_agreement"] == 1.0
    assert rows["default"]["train_agreement"] >= 0.999
    assert rows["random"]["heldout_agreement"] < 0.3
    assert rows["default"]["bins"] == rows["paper"]["bins"] == rows["bundled"]["bins"] == 32
    assert rows["hand_written"]["pairs_stored"] == 5


@pytest.mark.slow
def test_the_table_is_what_the_records_say(finished: tuple[Path, str]) -> None:
    folder, _ = finished
    records = episodes(folder)
    for row in results(folder)["table"]:
        own = [record for record in records if record["controller"] == row["controller"]]
        assert len(own) == row["episodes"]
        assert row["success_rate"] == pytest.approx(np.mean([record["success"] for record in own]))
        assert row["escape_rate"] == pytest.approx(np.mean([record["escaped"] for record in own]))
        common = [record["success"] for record in own if record["episode"] < 4]
        assert (row["common_episodes"], row["common_rate"]) == (4, np.mean(common))
        assert results(folder)["metrics"][f"{row['controller']}.success_rate"] == row["success_rate"]


@pytest.mark.slow
def test_all_controllers_meet_the_same_starts(finished: tuple[Path, str]) -> None:
    starts: dict[int, set[tuple[float, ...]]] = {}
    for record in episodes(finished[0]):
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
    assert "torchvsa corral demonstrations=6 " in text


@pytest.mark.slow
def test_what_was_learned_is_kept_and_can_be_learned_again(finished: tuple[Path, str], tmp_path: Path) -> None:
    folder, _ = finished
    bank = BehaviourBank.load(only(folder, "behaviours.safetensors"))
    assert bank.names == ["default", "seek_light", "avoid", "cruise"]
    for name in ("paper", "paper_best_bins", "hand_written"):
        assert BehaviourBank.load(only(folder, f"{name}.safetensors")).names == [name]
    shown = only(folder, "demonstrations.safetensors")
    demonstrations = Demonstrations.load(shown)
    assert len(demonstrations.episodes.unique()) == 6
    shutil.copy(shown, tmp_path / "shown.safetensors")
    own = ("demonstrations_file=shown.safetensors", "controllers=[default]", "animate=false", "vsa.dim=1000")
    output_of(tmp_path, "corral", *own, "starts=1", "validation_starts=1", "seconds=2", "workers=1")
    again = BehaviourBank.load(only(tmp_path, "behaviours.safetensors"))
    assert torch.equal(again["default"].program, bank["default"].program)
    agreed = bank["default"](demonstrations.sensors).commands == demonstrations.commands
    assert agreed.all(-1).double().mean() > 0.95


def without_timings(outcome: Outcome, *controllers: str) -> list[Row]:
    """The records of some controllers, without what may differ from run to run, and without columns of others."""
    records = outcome.records.drop(columns="query_us")
    rows = records.loc[records.controller.isin(controllers)]
    found = [{key: value for key, value in row.items() if not pd.isna(value)} for row in rows.to_dict(orient="records")]
    return sorted(found, key=lambda row: row["controller"])


@pytest.mark.slow
def test_the_same_seed_gives_the_same_results_whatever_the_workers(tmp_path: Path) -> None:
    some = ("teacher", "default", "bundled", "random")
    other = small_run(tmp_path, f"controllers=[{','.join(some)}]", "workers=2", "robots=3", "animate=false")
    found = without_timings(other, *some)
    assert len(found) > 32
    assert found == without_timings(full_run(), *some)


def test_an_optimiser_is_given_the_success_of_the_default() -> None:
    assert study.objective is not None
    assert full_run().metrics[study.objective] == next(
        row["success_rate"] for row in full_run().table if row["controller"] == "default"
    )


def test_a_cell_for_each_controller_and_the_slowest_first() -> None:
    cells = [cell["controller"] for cell in study.cells(settings())]
    assert sorted(cells) == sorted(settings().controllers)
    assert cells[:2] == ["teacher_wheeled", "default_bullet"]
