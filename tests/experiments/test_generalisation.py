"""The generalisation study: nested demonstrations, unseen conditions and arenas, and what the command reports."""

import io
import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from commands import only, output_of, results
from generalising import SMALL, Inline, default_settings, inline_workers, quiet, settings
from rich.console import Console

import sim
from experiments import generalisation, presets
from experiments import generalisation_corral as corral
from experiments.generalisation_corral import Combination, Lesson
from experiments.jobs import run_jobs


def test_larger_demonstrations_contain_the_smaller_ones_and_draws_share_none() -> None:
    own = default_settings()["corral"]
    for draw in range(3):
        episodes = [corral.episodes_shown(own, count, draw) for count in own["demonstrations"]]
        assert [len(each) for each in episodes] == [1, 2, 5, 10, 50]
        for smaller, larger in itertools.pairwise(episodes):
            assert larger[: len(smaller)] == smaller
        assert min(episodes[-1]) > own["starts"]
        assert not set(episodes[-1]) & set(corral.episodes_shown(own, 50, draw + 1))


def test_all_combinations_are_asked_the_default_first() -> None:
    own = default_settings()["corral"]
    combinations = corral.combinations(own)
    assert len(set(combinations)) == len(combinations) == 2 * 3 * 3 * 4
    assert combinations[0] == Combination("level", "none", "bind", "error_driven") == Combination.default(own)
    assert combinations[0].changes(Combination("lookup", "none", "bind", "gradient")) == ["encoder", "rule"]
    assert sum(len(one.changes(combinations[0])) == 1 for one in combinations) == 1 + 2 + 2 + 3


def lesson(readings: np.ndarray) -> Lesson:
    rows = np.arange(len(readings))
    return Lesson(readings, sim.Teacher()(readings), rows // 20)


READINGS = np.random.default_rng(5).uniform([0, 0, 0], [sensor.high for sensor in sim.SENSORS], (120, 3))


def test_unseen_samples_are_those_whose_bins_no_demonstration_met() -> None:
    config = settings("seconds=1", "corral.starts=2")
    new = READINGS[:30].copy()
    new[:10] = READINGS[100:110]
    examined = {"default": lesson(new), "narrow": lesson(READINGS[:20])}
    rows = corral.learn_and_ask(
        config, Combination.default(config["corral"]), 2, 0, 1, lesson(READINGS[100:]), examined
    )
    home, narrow = rows
    space = presets.space(config["vsa"], {p: config["corral"]["options"][p][c] for p, c in (
        ("encoder", "level"), ("protection", "none"), ("record", "bind"))}, 0)  # fmt: skip
    met = {tuple(row) for row in space.cells(READINGS[100:]).tolist()}
    unseen = [tuple(row) not in met for row in space.cells(new).tolist()]
    assert home["unseen_share"] == pytest.approx(np.mean(unseen))
    assert 0 < np.mean(unseen) < 1
    assert home["conditions"] == len(met)
    assert (home["episodes"], narrow["episodes"]) == (2, 2)
    # What was demonstrated is recalled, so all mistakes are in what was not.
    assert 30 * (1 - home["heldout"]) == pytest.approx(sum(unseen) * (1 - home["unseen"]))


def test_variants_drive_at_home_and_elsewhere_after_the_most_demonstrations() -> None:
    config = settings("seconds=1")
    own = config["corral"]
    shown, examined = lesson(READINGS), {arena: lesson(READINGS[:40]) for arena in own["arenas"]}
    default = Combination.default(own)
    one_part = Combination("level", "none", "bind", "one_shot")
    two_parts = Combination("level", "self_shift", "bind", "one_shot")

    def episodes(learner: Any, count: int) -> dict[str, int | None]:
        rows = corral.learn_and_ask(config, learner, count, 0, 2, shown, examined)
        return {row["arena"]: row["episodes"] for row in rows}

    assert episodes(default, 1) == {"default": 2, "narrow": 2}
    assert episodes(one_part, 1) == {"default": 1, "narrow": None}
    assert episodes(one_part, 2) == {"default": 1, "narrow": 1}
    assert episodes(two_parts, 2) == {"default": None}
    assert episodes("decision_tree", 1) == {"default": 1, "narrow": None}


def test_the_table_takes_medians_over_draws_and_pools_their_starts() -> None:
    base = {"learner": "x", **dict.fromkeys(corral.PARTS), "arena": "default", "demonstrations": 1, "unseen": None}
    records = [
        {**base, "draw": draw, "heldout": value, "episodes": 10, "successes": won}
        for draw, (value, won) in enumerate([(0.5, 2), (0.9, 9), (0.8, 10)])
    ]
    (row,) = corral.table(records)
    assert (row["heldout"], row["heldout_min"], row["heldout_max"], row["unseen"]) == (0.8, 0.5, 0.9, None)
    assert (row["episodes"], row["success_rate"]) == (30, 0.7)
    assert (row["success_low"], row["success_high"]) == sim.wilson(21, 30)


def test_jobs_keep_their_order_and_tell_their_errors() -> None:
    with quiet() as progress:
        assert run_jobs(Inline(), progress, "", pow, [(2, 3), (3, 2)]) == [8, 9]
        with pytest.raises(ZeroDivisionError):
            run_jobs(Inline(), progress, "", divmod, [(4, 2), (1, 0)])


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("parts=[]", "parts is empty; choose from corral, wall_following, smooth, fit_times"),
        ("parts=[corral,fit_times]", "fit_times wants the machine to itself"),
        ("workers=0", "workers=0"),
        ("corral.demonstrations=[2,1]", "corral.demonstrations are growing numbers"),
        ("corral.draws=[1]", "corral.draws gives a number"),
        ("corral.starts=1", "corral.starts=1"),
        ("corral.arenas=[narrow]", "corral.arenas begins with 'default'"),
        ("corral.arenas=[default,moon]", "there is no arena 'moon'"),
        ("corral.rivals=[nobody]", "corral.rivals: there is no 'nobody'"),
        ("corral.rule=[magic]", "corral.rule: there is no 'magic'; choose from error_driven, one_shot, least_squares"),
        ("wall_following.models=[nobody]", "wall_following.models: there is no 'nobody'"),
        ("wall_following.sensors=[3]", "wall_following.sensors: there is no 3; choose from 24, 4, 2"),
        ("wall_following.stratified_only=[nobody]", "wall_following.stratified_only: there is no 'nobody'"),
        ("wall_following.torchhd_epochs=0", "wall_following.torchhd_epochs=0"),
        ("smooth.tasks=[flying]", "smooth.tasks: there is no 'flying'; choose from corral, wall_following"),
        ("smooth.levels=[1]", "smooth.levels are numbers from 2 on"),
        ("smooth.starts=0", "smooth.starts=0"),
        ("smooth.blocks=6", "smooth.blocks=6: there are 5"),
    ],
)
def test_wrong_settings_are_named(override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        generalisation.check(settings(override))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("generalisation")
    return folder, output_of(folder, *SMALL, module="experiments.generalisation")


def test_the_command_writes_table_records_and_page(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    content = results(folder)
    records = pq.read_table(only(folder, "records.parquet")).to_pylist()
    table: list[dict[str, Any]] = content["table"]
    assert {row["part"] for row in table} == {"corral", "wall_following", "smooth"}
    own = [row for row in table if row["part"] == "corral"]
    assert {(row["learner"], row["arena"], row["demonstrations"]) for row in own if row["encoder"] is None} == {
        ("teacher", "default", None), ("teacher", "narrow", None),
        ("decision_tree", "default", 1), ("decision_tree", "default", 2),
        ("decision_tree", "narrow", 1), ("decision_tree", "narrow", 2),
    }  # fmt: skip
    for row in own:
        keys = ("learner", "arena", "demonstrations")
        drawn = [r for r in records if r["part"] == "corral" and all(r[key] == row[key] for key in keys)]
        assert row["draws"] == len(drawn) == (2 if row["demonstrations"] == 1 else 1)
        assert row["heldout"] == np.median([r["heldout"] for r in drawn])
        if row["success_rate"] is not None:
            assert row["success_rate"] * row["episodes"] == sum(r["successes"] for r in drawn)
    home = {row["demonstrations"]: row for row in own if row["learner"].endswith("none/bind/error_driven")}
    assert home[2]["episodes"] == 4
    name = "corral.level/none/bind/error_driven.default.2.heldout"
    wanted = next(r for r in own if r["learner"] == "level/none/bind/error_driven" and r["demonstrations"] == 2)
    assert content["metrics"][name] == wanted["heldout"] > 0.5
    (tree,) = [row for row in table if row.get("model") == "decision_tree"]
    assert tree["accuracy"] == content["metrics"]["wall_following.decision_tree.2.blocks.accuracy"] > 0.99
    errors = {(row["model"], row["dim"]): row["rmse"] for row in table if row["part"] == "smooth"}
    assert errors["one_hypervector", 200] < errors["ridge", None]
    assert "Wall following: accuracy" in printed
    page = only(folder, "report.html").read_text()
    assert page.count("data:image/png;base64,") == 3
    names = {"corral.png", "wall_following.png", "smooth.png", "generalisation.png"}
    assert {path.name for path in folder.rglob("*.png")} == names


def test_the_same_seed_gives_the_same_results(
    finished: tuple[Path, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(generalisation, "workers", inline_workers)
    again = generalisation.study(settings("parts=[corral]", "robots=3"), tmp_path, Console(file=io.StringIO()))
    before = [row for row in results(finished[0])["table"] if row["part"] == "corral"]
    assert again.table == before


def test_a_wrong_setting_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")  # which the command changes
    monkeypatch.setattr(sys, "argv", ["generalisation", "parts=[flying]"])
    with pytest.raises(SystemExit) as exit_:
        generalisation.main()
    assert exit_.value.code == 1
    wanted = "generalisation: parts: there is no 'flying'; choose from corral, wall_following, smooth, fit_times\n"
    assert capsys.readouterr().err == wanted
    assert not list(tmp_path.rglob("results.json"))
