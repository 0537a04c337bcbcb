"""A sequence of two lamps, from few starts."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from kits import composed
from rich.console import Console

import sim
from behaviours import ErrorDriven
from experiments.composition.sequence import check, study
from experiments.kit.run import check_all, run
from experiments.tasks import two_lamps


@pytest.mark.slow
def test_a_robot_goes_to_the_lamp_that_was_never_demonstrated(tmp_path: Path) -> None:
    settings = composed(
        study, "arenas=[lamp_room]", "codebooks=2", "starts=6", "bullet_starts=2", "wheeled_starts=2", "heldout=4",
        "workers=1",
    )  # fmt: skip
    outcome = run(study, settings, tmp_path, Console(quiet=True))
    driven = outcome.records.loc[outcome.records.row == "one_vector"].groupby("engine")[["episode", "codebook"]]
    places = {engine: sorted(zip(own.episode, own.codebook, strict=True)) for engine, own in driven}
    assert places == {
        engine: [(start, start % 2) for start in range(count)]
        for engine, count in (("vector", 6), ("bullet", 2), ("wheeled", 2))
    }
    for row in outcome.table:
        if row["engine"] != "vector":
            assert row["minus_vector"] == row["success_rate"] - 1
            assert row["episodes"] == 2 or (row["row"], row["engine"]) == ("one_vector_common", "wheeled")
    rows = {row["row"]: row for row in outcome.table if row["engine"] == "vector"}
    assert {name: row["success_rate"] for name, row in rows.items()} == {
        "teacher": 1.0,
        "one_vector": 1.0,
        "one_vector_common": 1.0,
    }
    assert rows["one_vector"]["agreement"] > 0.95
    (table,) = study.shown(outcome)
    assert "| one_vector | lamp_room | vector | 6 | 1.000 [0.610, 1.000] |" in table.markdown()
    assert "100.0% of 6 starts" in study.headline(outcome)
    paths = pd.read_parquet(tmp_path / "paths" / "lamp_room.parquet")
    assert paths.episode.unique().tolist() == [0, 1, 2, 3]
    for _, path in paths.groupby("episode"):  # first to one lamp, then to the other
        spoken = [name for name, before in zip(path.speaker, [None, *path.speaker], strict=False) if name != before]
        assert spoken == ["to blue", "to yellow"]
    assert (tmp_path / "figures" / "paths.png").is_file()
    assert (tmp_path / "figures" / "animation_lamp_room.gif").read_bytes().startswith(b"GIF8")


@pytest.mark.slow
def test_a_policy_that_is_asked_once_drives_as_it_does_itself() -> None:
    taught = two_lamps.runs("lamp_room", "blue", range(1_000_000, 1_000_003), 0, 60.0)
    both = two_lamps.bank(two_lamps.space(1000, 32, 0), taught, ErrorDriven())
    policy = two_lamps.policy(both, taught, ErrorDriven(margin=5), 0)
    one, other = (
        sim.rollout(driver, "lamp_room", task=two_lamps.TASK, episodes=range(2), seconds=12)
        for driver in (policy, two_lamps.AskedOnce(policy))
    )
    for field in ("x", "y", "commands"):
        assert np.array_equal(getattr(one.trajectory, field), getattr(other.trajectory, field))


def test_the_room_has_the_two_lamps_and_no_gap() -> None:
    arena = sim.find_arena("lamp_room")
    assert sim.Task.of(arena) == two_lamps.TASK
    assert len(arena.obstacles) == 4
    check(composed(study))


@pytest.mark.parametrize(
    ("override", "words"),
    [
        (
            "arenas=[default]",
            "arenas: default has no blue lamp and then a yellow one; choose from lamp_room, two_lamps",
        ),
        ("starts=5", "starts=5: expected at least one for each of codebooks=10"),
        ("bullet_starts=1", "bullet_starts=1: expected at least one for each of codebooks=10"),
        ("dim=333", "dim=333: expected an even number"),
    ],
)
def test_what_cannot_work_is_refused(override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, composed(study, override))


def test_a_teacher_that_solves_no_start_leaves_an_empty_row() -> None:
    settings = composed(study, "arenas=[lamp_room]", "workers=1")
    keys = {"arena": "lamp_room", "episode": 0, "success": False, "codebook": 0, "agreement": None}
    rows = [
        {**keys, "engine": engine, "row": row} for engine in ("vector", "bullet") for row in ("teacher", "one_vector")
    ]
    table = {(row["engine"], row["row"]): row for row in study.summarise(settings, pd.DataFrame(rows))}
    assert table["bullet", "one_vector_common"]["episodes"] == 0
    assert table["bullet", "one_vector"]["minus_vector"] == 0
