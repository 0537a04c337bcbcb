"""The corral's generalisation: nested demonstrations, unseen conditions and arenas, and what the command reports."""

import itertools
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from commands import drawn_again, only, results, shared_output_of
from kits import composed
from rich.console import Console

import sim
from behaviours import Demonstrations
from experiments.generalisation.combinations import Combination, codebooks
from experiments.generalisation.corral import Generalisation, Material, cells, episodes_of, measure, study
from experiments.generalisation.corral_results import summarise
from experiments.kit.run import check_all, run

TINY = (
    "vsa.dim=300",
    "demonstrations=[1,2]",
    "draws=[2,1]",
    "encoders=[level]",
    "protections=[none,self_shift]",
    "records=[product]",
    "rules=[error_driven,one_shot]",
    "arenas=[default,narrow]",
    "baselines=[decision_tree]",
    "starts=4",
    "variant_starts=2",
    "seconds=3",
    "bullet_starts=0",
    "wheeled_starts=0",
    "workers=1",
)
DEFAULT = "level/none/product/error_driven"


def settings(*overrides: str) -> Generalisation:
    return cast(Generalisation, composed(study, *overrides))


def test_larger_demonstrations_contain_the_smaller_ones_and_draws_share_none() -> None:
    config = settings()
    for draw in range(3):
        episodes = [list(episodes_of(config, count, draw)) for count in config.demonstrations]
        assert [len(each) for each in episodes] == [1, 2, 5, 10, 50]
        for smaller, larger in itertools.pairwise(episodes):
            assert larger[: len(smaller)] == smaller
        assert min(episodes[-1]) > config.starts
        assert not set(episodes[-1]) & set(episodes_of(config, 50, draw + 1))


def test_all_combinations_are_compared_the_default_first() -> None:
    combinations = settings().combinations()
    assert len(set(combinations)) == len(combinations) == 2 * 3 * 3 * 4
    assert combinations[0] == Combination("level", "none", "product", "error_driven") == Combination.parse(DEFAULT)
    other = Combination("lookup", "none", "product", "gradient")
    assert other.changes(combinations[0]) == {"encoder": "lookup", "rule": "gradient"}
    assert sum(len(one.changes(combinations[0])) == 1 for one in combinations) == 1 + 2 + 2 + 3


def test_the_options_behind_the_names_are_settings() -> None:
    config = settings("options.encoder.level.bins=16", "encoder@options.encoder.lookup=circular", "vsa.dim=64")
    assert config.options.encoder.level == {"name": "level", "bins": 16, "span": 8}
    assert config.options.encoder.lookup["name"] == "circular"
    space = codebooks(config.options, config.vsa, config.combinations()[0], 0)
    assert (space.encoder.bins, space.vsa.dim) == (16, 64)


def test_each_learner_sees_each_draw_and_the_most_demonstrations_come_first() -> None:
    config = settings(*TINY)
    found = [tuple(cell.values()) for cell in cells(config)]
    learners = [combination.name for combination in config.combinations()] + ["decision_tree"]
    assert found[0] == ("teacher", None, None)
    assert found[1:] == [(learner, count, draw) for count, draw in ((2, 0), (1, 0), (1, 1)) for learner in learners]


READINGS = np.random.default_rng(5).uniform([0, 0, 0], [sensor.high for sensor in sim.SENSORS], (120, 3))


def commanded(readings: np.ndarray) -> Demonstrations:
    """What the teacher does, as the first demonstrations of draw 0: 60 rows each."""
    return Demonstrations(readings, sim.Teacher()(readings), 1_000_000 + np.arange(len(readings)) // 60)


def test_unseen_samples_are_those_whose_bins_were_not_demonstrated() -> None:
    config = settings(*TINY, "seconds=1", "starts=2")
    new = READINGS[:30].copy()
    new[:10] = READINGS[100:110]
    train = commanded(READINGS[100:])
    material = Material(config, [train], {"default": commanded(new), "narrow": commanded(READINGS[:20])}, [])
    home, narrow = measure(material, {"learner": DEFAULT, "demonstrations": 2, "draw": 0})
    space = codebooks(config.options, config.vsa, Combination.parse(DEFAULT), 0)
    known = {tuple(row) for row in space.cells(READINGS[100:]).tolist()}
    unseen = [tuple(row) not in known for row in space.cells(new).tolist()]
    assert home["unseen_share"] == pytest.approx(np.mean(unseen))
    assert 0 < np.mean(unseen) < 1
    assert (home["samples"], home["conditions"]) == (20, len(known))
    assert (home["episodes"], narrow["episodes"]) == (2, 2)
    # What was demonstrated is recalled, so all mistakes are in what was not.
    assert 30 * (1 - home["heldout"]) == pytest.approx(sum(unseen) * (1 - home["unseen"]))


def test_variants_drive_at_home_and_elsewhere_after_the_most_demonstrations() -> None:
    config = settings(*TINY, "seconds=1")
    heldout = {arena: commanded(READINGS[:40]) for arena in config.arenas}
    material = Material(config, [commanded(READINGS)] * 2, heldout, [])

    def episodes(learner: str, count: int) -> dict[str, int | None]:
        rows = measure(material, {"learner": learner, "demonstrations": count, "draw": 0})
        assert {row["samples"] for row in rows} == {60 * count}
        return {row["arena"]: row.get("episodes") for row in rows}

    assert episodes(DEFAULT, 1) == {"default": 2, "narrow": 2}
    assert episodes("level/none/product/one_shot", 1) == {"default": 1, "narrow": None}
    assert episodes("level/none/product/one_shot", 2) == {"default": 2, "narrow": 2}
    assert episodes("level/self_shift/product/one_shot", 2) == {"default": None}
    assert episodes("decision_tree", 1) == {"default": 1, "narrow": None}


def test_the_table_takes_medians_over_draws_and_pools_their_starts() -> None:
    base: dict[str, Any] = {"learner": "x", "arena": "default", "demonstrations": 1}
    records = [
        {**base, "draw": draw, "heldout": value, "episodes": 10, "successes": won}
        for draw, (value, won) in enumerate([(0.5, 2), (0.9, 9), (0.8, 10)])
    ]
    (row,) = summarise(settings(*TINY), pd.DataFrame(records))
    assert (row["heldout"], row["heldout_min"], row["heldout_max"]) == (0.8, 0.5, 0.9)
    assert pd.isna(row["unseen"])
    assert (row["draws"], row["episodes"], row["success_rate"]) == (3, 30, 0.7)
    assert (row["success_low"], row["success_high"]) == pytest.approx(sim.wilson(21, 30))


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("workers=0", "workers=0"),
        ("demonstrations=[2,1]", "demonstrations are growing numbers"),
        ("draws=[1]", "draws gives a number"),
        ("starts=1", "starts=1: expected at least one for each of 2 draws"),
        ("variant_starts=1", "variant_starts=1: expected at least one"),
        ("arenas=[narrow]", "arenas begins with 'default'"),
        ("arenas=[default,moon]", "arenas: there is no 'moon'; choose from default, "),
        ("baselines=[nobody]", "baselines: there is no 'nobody'; choose from nearest_neighbour, decision_tree"),
        ("rules=[magic]", "rules: there is no 'magic'; choose from error_driven, one_shot, least_squares, gradient"),
        ("options.encoder.level.bins=0", "bins"),
        ("vsa=hrr rules=[least_squares]", "the rule least_squares cannot train programs of HRR"),
    ],
)
def test_wrong_settings_are_named(override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, settings(*TINY, *override.split()))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("generalisation")
    return folder, shared_output_of(folder, "generalisation", *TINY)


def test_the_command_writes_table_records_and_page(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    content = results(folder)
    records = pq.read_table(only(folder, "records.parquet")).to_pylist()
    table: list[dict[str, Any]] = content["table"]
    keys = ("learner", "arena", "demonstrations")
    assert {tuple(row[key] for key in keys) for row in table if "encoder" not in row} == {
        ("teacher", "default", None), ("teacher", "narrow", None),
        ("decision_tree", "default", 1), ("decision_tree", "default", 2),
        ("decision_tree", "narrow", 1), ("decision_tree", "narrow", 2),
    }  # fmt: skip
    for row in table:
        drawn = [record for record in records if all(record[key] == row[key] for key in keys)]
        assert row["draws"] == len(drawn) == (2 if row["demonstrations"] == 1 else 1)
        assert row["heldout"] == np.median([record["heldout"] for record in drawn])
        if row["success_rate"] is not None:
            assert row["success_rate"] * row["episodes"] == sum(record["successes"] for record in drawn)
    home = {row["demonstrations"]: row for row in table if row["learner"] == DEFAULT and row["arena"] == "default"}
    assert home[2]["episodes"] == 4
    assert content["metrics"][f"{DEFAULT}.default.2.heldout"] == home[2]["heldout"] > 0.5
    assert content["metrics"]["teacher.default.heldout"] == 1
    assert "Success, by demonstrations" in printed
    page = only(folder, "report.html").read_text()
    assert page.count("data:image/png;base64,") == 1
    assert [path.name for path in folder.rglob("*.png")] == ["generalisation.png"]
    assert f"After 2 demonstrations <code>{DEFAULT}</code> agrees with its teacher" in page


def test_the_page_is_drawn_again_from_the_folder(finished: tuple[Path, str], monkeypatch: pytest.MonkeyPatch) -> None:
    page = only(finished[0], "report.html")
    before = page.read_text()
    monkeypatch.setattr(sim, "rollout", None)
    assert drawn_again(page) == before


def test_the_same_seed_gives_the_same_results(finished: tuple[Path, str], tmp_path: Path) -> None:
    again = run(study, settings(*TINY, "robots=3", "protections=[none]"), tmp_path, Console(quiet=True))
    before = [row for row in results(finished[0])["table"] if "self_shift" not in row["learner"]]
    assert again.table == before
    assert {row["learner"] for row in before} >= {"teacher", DEFAULT, "level/none/product/one_shot", "decision_tree"}
