"""Behaviour cloning: the experts, paired starts, and the command."""

from pathlib import Path
from typing import cast

import numpy as np
import pytest
from commands import only, output_of, results
from kits import composed

from experiments import cloning
from experiments.tasks.control import EXPERTS, run

GOOD = {"CartPole-v1": 499, "Acrobot-v1": -110, "MountainCar-v0": -125, "LunarLander-v3": 200, "Pendulum-v1": -250}
"""Between what a random controller returns and what the best known ones do."""


@pytest.mark.parametrize("task", EXPERTS)
def test_an_expert_solves_its_task(task: str) -> None:
    pytest.importorskip("Box2D")
    assert run(task, EXPERTS[task], range(8)).returns.mean() > GOOD[task]


def test_an_episode_does_not_depend_on_those_beside_it() -> None:
    together = run("Acrobot-v1", EXPERTS["Acrobot-v1"], range(5))
    alone = [run("Acrobot-v1", EXPERTS["Acrobot-v1"], [seed]) for seed in range(5)]
    assert together.returns.tolist() == [one.returns[0] for one in alone]
    assert len(together.observations) == sum(len(one.observations) for one in alone) == -together.returns.sum() + 5
    assert together.observations[:5].tolist() == [one.observations[0].tolist() for one in alone]


def test_commands_of_any_value_stay_within_those_shown() -> None:
    settings = cast(cloning.Cloning, composed(cloning.study, "starts=3"))
    found = cloning.measure(settings, {"task": "Pendulum-v1", "learner": "decision_tree", "episodes": 2, "draw": 0})
    assert found["rows"] == 400
    assert -1700 < found["mean_return"] < -100


def test_ranks_compare_with_the_median_and_the_best_of_the_others() -> None:
    row = {cloning.OURS: 2.0, "a": 1.0, "b": 2.0, "c": 3.0}
    assert cloning.ranks(row, list(row)) == {"at_least_median": True, "at_least_best": False}
    assert cloning.ranks(row, [cloning.OURS]) == {}


def test_the_command_compares_learners(tmp_path: Path) -> None:
    output_of(
        tmp_path, "cloning", "experiment=quick", "tasks=[CartPole-v1]", "learners=[one_hypervector,decision_tree]",
        "episodes=[1]", "starts=5", "workers=1",
    )  # fmt: skip
    (row,) = results(tmp_path)["table"]
    assert row["expert"] == 500
    assert row["rows"] == 500
    for learner in ("one_hypervector", "decision_tree"):
        assert 50 < row[f"{learner}_low"] <= row[learner] <= row[f"{learner}_high"] <= 500
    assert np.isclose(row["at_least_best"], row["one_hypervector"] >= row["decision_tree"])
    assert "one hypervector returns at least the median" in only(tmp_path, "report.html").read_text()
