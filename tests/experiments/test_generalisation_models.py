"""The generalisation study's models: exact folds, torch-hd or a note, smooth teachers."""

import importlib.util

import numpy as np
import pytest
import torch
from generalising import Inline, default_settings, quiet, settings

import sim
from behaviours import BehaviourClassifier
from behaviours.data import load_wall_following
from experiments import generalisation
from experiments import generalisation_fit_times as fit_times
from experiments import generalisation_smooth as smooth
from experiments import generalisation_wall_following as wall
from experiments.models.torchhd import TorchHD, installed


def test_stratified_folds_are_drawn_with_seed_0_and_spread_every_class() -> None:
    labels = load_wall_following(2)[1]
    folds = wall.stratified(labels)
    assert np.array_equal(np.sort(np.concatenate([test for _, test in folds])), np.arange(5456))
    for train, test in folds:
        assert not np.intersect1d(train, test).size
        assert len(train) + len(test) == 5456
        shares = [(labels[test] == name).sum() - (labels == name).sum() / 5 for name in np.unique(labels)]
        assert np.abs(shares).max() < 1
    # Shuffled, always alike.
    assert np.array_equal(folds[0][1][:5], wall.stratified(labels)[0][1][:5])
    assert np.abs(np.corrcoef(np.concatenate([test for _, test in folds]), np.arange(5456))[0, 1]) < 0.5


def test_blocks_are_five_stretches_of_time() -> None:
    folds = wall.blocks(load_wall_following(2)[1])
    assert [len(test) for _, test in folds] == [1092, 1091, 1091, 1091, 1091]
    assert np.array_equal(np.concatenate([test for _, test in folds]), np.arange(5456))
    for train, test in folds:
        assert (np.diff(test) == 1).all()
        assert np.array_equal(np.union1d(train, test), np.arange(5456))


@pytest.mark.parametrize(("split", "published"), [("stratified", 0.995), ("blocks", 0.981)])
def test_a_decision_tree_reaches_the_figures_known_for_these_folds(split: str, published: float) -> None:
    records = [wall.fit_and_ask({}, "decision_tree", 24, split, fold, 0) for fold in range(5)]
    (row,) = wall.table(records, ["decision_tree"])
    assert row["accuracy"] == pytest.approx(published, abs=0.004)
    assert row["accuracy"] == pytest.approx(np.mean([record["accuracy"] for record in records]))
    assert row["fit_s"] == pytest.approx(sum(record["fit_s"] for record in records))


def test_one_hypervector_learns_the_real_robot() -> None:
    record = wall.fit_and_ask({"dim": 300}, "one_hypervector", 2, "stratified", 0, 0)
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


def test_slow_models_are_asked_about_random_fifths_only() -> None:
    config = settings("wall_following.models=[decision_tree,nearest_neighbour]")
    config["wall_following"] |= {"splits": ["stratified", "blocks"], "stratified_only": ["nearest_neighbour"]}
    with quiet() as progress:
        records = wall.run(config, Inline(), progress)
    folds = {(record["model"], record["split"], record["fold"]) for record in records}
    assert folds == {
        (model, split, fold)
        for model, split in (
            ("decision_tree", "stratified"),
            ("decision_tree", "blocks"),
            ("nearest_neighbour", "stratified"),
        )
        for fold in range(5)
    }
    assert len(records) == len(folds)


def test_without_torch_hd_its_rows_are_absent_and_a_note_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "torchhd" else find(name))
    config = settings("parts=[wall_following]")
    (note,) = generalisation.notes(config)
    assert "torch-hd is not installed" in note
    assert "torchhd_vanilla" in note
    with quiet() as progress:
        records = wall.run(config, Inline(), progress)
    assert {record["model"] for record in records} == {"decision_tree"}
    with pytest.raises(ValueError, match="pip install torch-hd"):
        generalisation.check(settings("parts=[fit_times]"))


@pytest.mark.skipif(not installed(), reason="torch-hd is not installed")
def test_fit_times_alternate_fold_by_fold(monkeypatch: pytest.MonkeyPatch) -> None:
    config = settings("fit_times.folds=2", "fit_times.sensors=2", "fit_times.dim=50", "fit_times.adapthd_epochs=1")
    config["fit_times"]["threads"] = 1
    monkeypatch.setitem(wall.MODELS, "one_hypervector", lambda own, seed: BehaviourClassifier(own["dim"], epochs=1))
    threads = torch.get_num_threads()
    with quiet() as progress:
        records = fit_times.run(config, Inline(), progress)
    assert [(record["model"], record["fold"]) for record in records] == [
        (model, fold) for fold in (0, 1) for model in ("one_hypervector", "torchhd_adapthd")
    ]
    assert all(record["fit_s"] > 0 for record in records)
    assert torch.get_num_threads() == threads
    assert default_settings()["fit_times"]["adapthd_epochs"] is None


def test_the_smooth_teachers_have_no_steps_and_stay_within_what_wheels_can_do() -> None:
    rng = np.random.default_rng(0)
    sensors = rng.uniform([0, 0, 0], [sensor.high for sensor in sim.SENSORS], (2000, 3))
    nudge = rng.uniform(-1e-6, 1e-6, sensors.shape)
    commands = smooth.corral_commands(sensors)
    assert np.abs(smooth.corral_commands(sensors + nudge) - commands).max() < 1e-4
    assert np.abs(commands).max() <= 1
    assert len(np.unique(commands.round(3), axis=0)) > 500
    # In the dark it drives straight on, and turns left on the spot before a wall; it steers towards the light.
    dark = np.array([[5.0, 5.0, 0.6], [5.0, 5.0, 0.0], [3.0, 5.0, 0.6]])
    np.testing.assert_allclose(smooth.corral_commands(dark), [[1, 1], [-1, 1], [0.2, 1]])
    front, left = rng.uniform(0, 5, (2, 2000))
    wheels = smooth.wall_commands(front, left)
    assert np.abs(smooth.wall_commands(front + 1e-6, left - 1e-6) - wheels).max() < 1e-4
    assert np.abs(wheels).max() <= 1
    # Blocked: to the right. Free, with the wall far away on the left: to the left.
    blocked, free = smooth.wall_commands(np.array([0.3, 4.0]), np.array([0.7, 2.0]))
    assert blocked[0] > blocked[1]
    assert free[0] < free[1]


def test_levels_answer_with_results_that_were_shown() -> None:
    readings = np.linspace(0, 1, 200)[:, None]
    commands = np.concatenate([2 * readings - 1, 1 - 2 * readings], axis=1)
    model = smooth.Levels(5, 500, 0).fit(readings, commands)
    np.testing.assert_allclose(
        model.rounded(np.array([[0.3, -0.2], [0.9, -0.75]])), [[0.5, 0.0], [1.0, -1.0]], atol=0.3
    )
    answers = model.predict(readings)
    assert set(map(tuple, answers)) <= {(-1, 1), (-0.5, 0.5), (0, 0), (0.5, -0.5), (1, -1)}
    assert np.sqrt(np.mean((answers - commands) ** 2)) < 0.25


def test_interpolation_comes_closer_than_three_levels() -> None:
    config = settings("smooth.starts=1", "seconds=1")
    angle = np.random.default_rng(1).uniform(0, 6, (400, 1))
    wave = np.concatenate([np.sin(angle), np.cos(angle)], axis=1)
    data = (angle[:300], wave[:300], angle[300:], wave[300:])
    rows = [
        smooth.fit_and_ask(config, model, dim, levels, "wave", 0, *data)
        for model, dim, levels in (("one_hypervector", 500, None), ("levels", 500, 3), ("ridge", None, None))
    ]
    assert rows[0]["rmse"] < 0.1 < rows[1]["rmse"] < rows[2]["rmse"]
    for row in rows:
        assert row["relative"] == pytest.approx(row["rmse"] / row["mean_rmse"])
        assert row["mean_rmse"] == pytest.approx(np.sqrt(np.mean((wave[300:] - wave[:300].mean(0)) ** 2)))
    rounding = np.round(wave[300:]) - wave[300:]
    assert rows[1]["rounding_rmse"] == pytest.approx(np.sqrt(np.mean(rounding**2)))
