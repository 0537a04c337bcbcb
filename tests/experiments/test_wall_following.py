"""Wall following: exact folds, published accuracies, torch-hd or a note, and what the command reports."""

import importlib.util
from pathlib import Path
from typing import cast

import numpy as np
import pyarrow.parquet as pq
import pytest
import torch
from commands import drawn_again, only, output_of, results
from kits import composed
from rich.console import Console

from behaviours.data import load_wall_following
from experiments.generalisation.wall_following import WallFollowing, cells, measure, study
from experiments.kit.run import check_all, load, run
from experiments.models.torchhd import TorchHD, installed
from experiments.tasks.wall_following import blocks, stratified, wall_commands

TINY = ("dim=200", "sensors=[2]", "splits=[blocks]", "models=[decision_tree,torchhd_vanilla]", "workers=1")


def settings(*overrides: str) -> WallFollowing:
    return cast(WallFollowing, composed(study, *overrides))


def test_stratified_folds_are_drawn_with_seed_0_and_spread_every_class() -> None:
    labels = load_wall_following(2)[1]
    folds = stratified(labels)
    assert np.array_equal(np.sort(np.concatenate([test for _, test in folds])), np.arange(5456))
    for train, test in folds:
        assert not np.intersect1d(train, test).size
        assert len(train) + len(test) == 5456
        shares = [(labels[test] == name).sum() - (labels == name).sum() / 5 for name in np.unique(labels)]
        assert np.abs(shares).max() < 1
    # Shuffled, always alike.
    assert np.array_equal(folds[0][1][:5], stratified(labels)[0][1][:5])
    assert np.abs(np.corrcoef(np.concatenate([test for _, test in folds]), np.arange(5456))[0, 1]) < 0.5


def test_blocks_are_five_stretches_of_time() -> None:
    folds = blocks(load_wall_following(2)[1])
    assert [len(test) for _, test in folds] == [1092, 1091, 1091, 1091, 1091]
    assert np.array_equal(np.concatenate([test for _, test in folds]), np.arange(5456))
    for train, test in folds:
        assert (np.diff(test) == 1).all()
        assert np.array_equal(np.union1d(train, test), np.arange(5456))


def test_a_decision_tree_reaches_the_figures_known_for_these_folds(tmp_path: Path) -> None:
    config = settings("sensors=[24]", "models=[decision_tree]", "workers=1")
    outcome = run(study, config, tmp_path, Console(quiet=True))
    rows = {row["split"]: row for row in outcome.table}
    for split, published in (("stratified", 0.995), ("blocks", 0.981)):
        records = outcome.records[outcome.records.split == split]
        assert rows[split]["accuracy"] == pytest.approx(published, abs=0.004)
        assert rows[split]["accuracy"] == pytest.approx(records.accuracy.mean())
        assert rows[split]["fit_s"] == pytest.approx(records.fit_s.sum())


def test_one_hypervector_learns_the_real_robot() -> None:
    cell = {"model": "one_hypervector", "sensors": 2, "split": "stratified", "fold": 0}
    record = measure(settings("dim=100"), cell)
    assert record["accuracy"] > 0.97
    assert record["rows"] == 1092


@pytest.mark.skipif(not installed(), reason="torch-hd is not installed")
def test_torch_hd_draws_from_its_seed_alone() -> None:
    readings, labels = load_wall_following(2)
    readings = (readings - readings.mean(0)) / readings.std(0)
    before = torch.random.get_rng_state()
    answers = [TorchHD("AdaptHD", 100, 1, seed).fit(readings, labels).predict(readings) for seed in (0, 0, 1)]
    assert torch.equal(torch.random.get_rng_state(), before)
    assert np.array_equal(answers[0], answers[1])
    assert not np.array_equal(answers[0], answers[2])
    assert (answers[0] == labels).mean() > 0.5


def test_slow_models_are_tested_on_random_fifths_only_and_come_first() -> None:
    found = cells(settings("models=[decision_tree,mlp]", "stratified_only=[mlp]", "sensors=[4]"))
    assert [tuple(cell.values()) for cell in found] == [
        (model, 4, split, fold)
        for model, split in (("mlp", "stratified"), ("decision_tree", "stratified"), ("decision_tree", "blocks"))
        for fold in range(5)
    ]


def test_without_torch_hd_its_rows_are_absent_and_a_note_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "torchhd" else find(name))
    with (tmp_path / "printed").open("w") as file:
        outcome = run(study, settings(*TINY), tmp_path, Console(file=file))
    assert {row["model"] for row in outcome.table} == {"decision_tree"}
    assert outcome.metrics["torchhd_installed"] == 0
    note = "torch-hd is not installed, so its classifiers are left out; pip install torch-hd brings them in"
    assert f"{note} (torchhd_vanilla)" in (tmp_path / "printed").read_text()
    assert f"{note} (torchhd_vanilla)" in (tmp_path / "report.html").read_text()
    with pytest.raises(ValueError, match=r"there is nothing to measure; torch-hd is not installed"):
        check_all(study, settings(*TINY, "models=[torchhd_lehdc]"))


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ("models=[nobody]", "models: there is no 'nobody'; choose from one_hypervector, "),
        ("models=[]", "models is empty"),
        ("sensors=[3]", "sensors: there is no 3; choose from 24, 4, 2"),
        ("stratified_only=[nobody]", "stratified_only: there is no 'nobody'"),
        ("torchhd_epochs=0", "torchhd_epochs=0: expected 1 or more"),
        ("models=[mlp] stratified_only=[mlp]", r"nothing to measure; stratified_only leaves none"),
    ],
)
def test_wrong_settings_are_named(overrides: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, settings(*TINY, *overrides.split()))


def test_the_command_writes_table_records_and_page(tmp_path: Path) -> None:
    printed = output_of(tmp_path, "wall_following", *TINY)
    content = results(tmp_path)
    records = pq.read_table(only(tmp_path, "records.parquet")).to_pylist()
    accuracies = [record["accuracy"] for record in records if record["model"] == "decision_tree"]
    assert len(accuracies) == 5
    tree = content["table"][0]
    assert (
        tree["accuracy"] == content["metrics"]["decision_tree.2.blocks.accuracy"] == pytest.approx(sum(accuracies) / 5)
    )
    assert (tree["accuracy_min"], tree["accuracy_max"]) == (min(accuracies), max(accuracies))
    assert tree["accuracy"] > 0.99
    assert content["metrics"]["torchhd_installed"] == float(installed())
    assert "Wall following: accuracy" in printed
    page = only(tmp_path, "report.html")
    before = page.read_text()
    assert before.count("data:image/png;base64,") == 1
    assert drawn_again(page) == before
    assert load(page.parent)[1].table == content["table"]


def test_the_teacher_along_a_wall_has_no_steps_and_stays_within_what_wheels_can_do() -> None:
    rng = np.random.default_rng(0)
    front, left = rng.uniform(0, 5, (2, 2000))
    wheels = wall_commands(front, left)
    assert np.abs(wall_commands(front + 1e-6, left - 1e-6) - wheels).max() < 1e-4
    assert np.abs(wheels).max() <= 1
    # Blocked: to the right. Free, with the wall far away on the left: to the left.
    blocked, free = wall_commands(np.array([0.3, 4.0]), np.array([0.7, 2.0]))
    assert blocked[0] > blocked[1]
    assert free[0] < free[1]
