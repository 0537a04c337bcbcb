"""Smooth commands: teachers without steps, levels, interpolation, and what the command reports."""

from pathlib import Path
from typing import cast

import numpy as np
import pytest
from commands import drawn_again, only, output_of, results
from kits import composed

import sim
from behaviours.data import load_wall_following
from experiments.generalisation.smooth import Material, Smooth, cells, measure, split, study
from experiments.kit.run import check_all
from experiments.models.regressors import Levels, errors, regressor
from experiments.tasks.smooth_corral import corral_commands
from experiments.tasks.wall_following import wall_commands

TINY = (
    "tasks=[corral]", "models=[one_hypervector,ridge]", "dims=[50,1000]", "demonstrations=2", "starts=2", "seconds=8",
    "workers=1",
)  # fmt: skip


def settings(*overrides: str) -> Smooth:
    return cast(Smooth, composed(study, *overrides))


def test_the_corrals_teacher_has_no_steps_and_stays_within_what_wheels_can_do() -> None:
    rng = np.random.default_rng(0)
    sensors = rng.uniform([0, 0, 0], [sensor.high for sensor in sim.SENSORS], (2000, 3))
    nudge = rng.uniform(-1e-6, 1e-6, sensors.shape)
    commands = corral_commands(sensors)
    assert np.abs(corral_commands(sensors + nudge) - commands).max() < 1e-4
    assert np.abs(commands).max() <= 1
    assert len(np.unique(commands.round(3), axis=0)) > 500
    # In the dark it drives straight on, and turns left on the spot before a wall; it steers towards the light.
    dark = np.array([[5.0, 5.0, 0.6], [5.0, 5.0, 0.0], [3.0, 5.0, 0.6]])
    np.testing.assert_allclose(corral_commands(dark), [[1, 1], [-1, 1], [0.2, 1]])


def test_levels_answer_with_results_that_were_shown() -> None:
    readings = np.linspace(0, 1, 200)[:, None]
    commands = np.concatenate([2 * readings - 1, 1 - 2 * readings], axis=1)
    model = Levels(5, 500, 0).fit(readings, commands)
    np.testing.assert_allclose(
        model.rounded(np.array([[0.3, -0.2], [0.9, -0.75]])), [[0.5, 0.0], [1.0, -1.0]], atol=0.3
    )
    answers = model.predict(readings)
    assert set(map(tuple, answers)) <= {(-1, 1), (-0.5, 0.5), (0, 0), (0.5, -0.5), (1, -1)}
    assert np.sqrt(np.mean((answers - commands) ** 2)) < 0.25


def test_interpolation_comes_closer_than_three_levels() -> None:
    angle = np.random.default_rng(1).uniform(0, 6, (400, 1))
    wave = np.concatenate([np.sin(angle), np.cos(angle)], axis=1)
    data = (angle[:300], wave[:300], angle[300:], wave[300:])
    rows = [
        errors(regressor(model, dim, levels, 0), *data)
        for model, dim, levels in (("one_hypervector", 500, None), ("levels", 500, 3), ("ridge", None, None))
    ]
    assert rows[0]["rmse"] < 0.1 < rows[1]["rmse"] < rows[2]["rmse"]
    for row in rows:
        assert row["relative"] == pytest.approx(row["rmse"] / row["mean_rmse"])
        assert row["mean_rmse"] == pytest.approx(np.sqrt(np.mean((wave[300:] - wave[:300].mean(0)) ** 2)))
    rounding = np.round(wave[300:]) - wave[300:]
    assert rows[1]["rounding_rmse"] == pytest.approx(np.sqrt(np.mean(rounding**2)))
    with pytest.raises(ValueError, match="levels needs a dimension"):
        regressor("levels", 500, None, 0)


def test_levels_have_the_largest_dimension_and_every_block_is_held_back() -> None:
    config = settings("models=[one_hypervector,levels,ridge]", "dims=[50,200]", "levels=[3,9]", "blocks=2")
    found = [tuple(cell.values()) for cell in cells(config)]
    variants = [
        ("levels", 200, 9), ("levels", 200, 3), ("one_hypervector", 200, None), ("one_hypervector", 50, None),
        ("ridge", None, None),
    ]  # fmt: skip
    folds = [("corral", 0), ("wall_following", 0), ("wall_following", 1)]
    assert {cell for cell in found if cell[1] != "teacher"} == {
        (task, *variant, fold) for variant in variants for task, fold in folds
    }
    assert [cell for cell in found if cell[1] == "teacher"] == [("corral", "teacher", None, None, 0)]
    assert found[0][1:4] == variants[0]


def test_the_real_robots_raw_distances_predict_the_wall_teachers_commands() -> None:
    config = settings("tasks=[wall_following]", "models=[ridge]")
    readings, commands, new_readings, target = split(Material(config), "wall_following", 1)
    assert (readings.shape, commands.shape) == ((4365, 24), (4365, 2))
    assert (new_readings.shape, target.shape) == ((1091, 24), (1091, 2))
    rows = slice(1092, 2183)
    assert np.array_equal(new_readings, load_wall_following(24)[0][rows])
    assert np.array_equal(target, wall_commands(*load_wall_following(2)[0][rows].T))
    row = measure(
        Material(config), {"task": "wall_following", "model": "ridge", "dim": None, "levels": None, "fold": 1}
    )
    assert row["samples"] == 1091
    assert 0 < row["relative"] < 1
    assert "episodes" not in row


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("tasks=[flying]", "tasks: there is no 'flying'; choose from corral, wall_following"),
        ("models=[nobody]", "models: there is no 'nobody'"),
        ("levels=[1]", r"levels=\[1\]: expected 2 or more"),
        ("dims=[]", "dims is empty"),
        ("starts=0", "starts=0: expected a number from 1 to 1000000"),
        ("blocks=6", "blocks=6: expected a number from 1 to 5"),
    ],
)
def test_wrong_settings_are_named(override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, settings(override))


def test_the_command_writes_table_and_page(tmp_path: Path) -> None:
    printed = output_of(tmp_path, "smooth", *TINY)
    content = results(tmp_path)
    rows = {(row["model"], row["dim"]): row for row in content["table"]}
    assert list(rows) == [("teacher", None), ("one_hypervector", 1000), ("one_hypervector", 50), ("ridge", None)]
    assert rows["one_hypervector", 1000]["rmse"] < rows["ridge", None]["rmse"]
    assert rows["teacher", None]["rmse"] == 0
    assert [row["episodes"] for row in rows.values()] == [2, 2, 0, 2]
    assert content["metrics"]["corral.one_hypervector.1000.rmse"] == rows["one_hypervector", 1000]["rmse"]
    assert "Smooth commands" in printed
    page = only(tmp_path, "report.html")
    before = page.read_text()
    assert before.count("data:image/png;base64,") == 1
    assert drawn_again(page) == before
