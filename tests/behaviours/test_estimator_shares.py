"""The share of weighted sums among the dimensions of an estimator."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from behaviours import BehaviourClassifier, BehaviourRegressor
from behaviours.learning.leave_one_out import leave_one_out_error
from behaviours.learning.ridge import RIDGES


def test_the_error_of_each_row_is_that_of_a_fit_to_all_others() -> None:
    rng = np.random.default_rng(0)
    rows, targets = rng.choice([-1, 1], (12, 30)), rng.normal(size=(12, 2))
    weights = rng.uniform(0.5, 2, 12)
    expected = []
    for ridge in RIDGES:
        squares = []
        for left in range(12):
            rest = np.arange(12) != left
            a = rows[rest] / 30**0.5
            matrix = (a * weights[rest, None]).T @ a + ridge * np.eye(30)
            program = np.linalg.solve(matrix, (a * weights[rest, None]).T @ targets[rest])
            squares.append(((rows[left] / 30**0.5 @ program - targets[left]) ** 2).mean())
        expected.append(np.average(squares, weights=weights))
    found = leave_one_out_error(torch.tensor(rows, dtype=torch.int8), torch.tensor(targets), torch.tensor(weights))
    assert found == pytest.approx(min(expected), rel=1e-5)


def diagonal() -> tuple[np.ndarray, np.ndarray]:
    X = np.random.default_rng(0).uniform(-1, 1, (600, 3))  # noqa: N806
    return X, np.sin(3 * X.sum(1))


def striped() -> tuple[np.ndarray, np.ndarray]:
    X = np.random.default_rng(0).uniform(-1, 1, (600, 3))  # noqa: N806
    return X, np.sign(np.sin(8 * X[:, 0]))


@pytest.mark.parametrize("make", [diagonal, striped])
def test_the_share_follows_the_data(make: Callable[[], tuple[np.ndarray, np.ndarray]]) -> None:
    X, y = make()  # noqa: N806
    model = BehaviourRegressor(dim=1000, random_state=0).fit(X[:400], y[:400])
    assert (model.oblique_ > 0) == (make is diagonal)
    scores = {
        share: BehaviourRegressor(dim=1000, oblique=share, random_state=0).fit(X[:400], y[:400]).score(X[400:], y[400:])
        for share in (0, 0.5)
    }
    assert (scores[0.5] > scores[0]) == (make is diagonal)
    labels = BehaviourClassifier(dim=1000, epochs=5, random_state=0).fit(X[:400], y[:400] > 0)
    assert (labels.oblique_ > 0) == (make is diagonal)


@pytest.mark.parametrize("share", [0, 0.3, 1])
@pytest.mark.parametrize("kind", [BehaviourClassifier, BehaviourRegressor])
def test_a_file_keeps_the_share(kind: type, share: float, tmp_path: Path) -> None:
    X, y = diagonal()  # noqa: N806
    X[:50, 2] = np.nan
    model = kind(dim=200, oblique=share, random_state=0).fit(X[:300], (y > 0)[:300])
    again = kind.load(model.save(tmp_path / "model.safetensors"))
    assert again.oblique_ == model.oblique_ == share
    assert again.get_params() == model.get_params()
    assert (again.predict(X) == model.predict(X)).all()


def test_neither_order_nor_copies_of_rows_change_the_choice() -> None:
    X, y = diagonal()  # noqa: N806
    one = BehaviourRegressor(dim=300, random_state=0).fit(X, y)
    order = np.random.default_rng(1).permutation(len(X))
    other = BehaviourRegressor(dim=300, random_state=0).fit(X[order], y[order])
    assert torch.equal(one.program_, other.program_)
    twice = BehaviourRegressor(dim=300, random_state=0).fit(np.r_[X, X], np.r_[y, y])
    weighted = BehaviourRegressor(dim=300, random_state=0).fit(X, y, np.full(len(X), 2.0))
    assert torch.equal(twice.program_, weighted.program_)


@pytest.mark.parametrize("wrong", [-0.1, 1.5, "half", np.nan])
def test_another_share_is_refused(wrong: Any) -> None:
    X, y = diagonal()  # noqa: N806
    with pytest.raises(ValueError, match="'oblique' parameter of BehaviourRegressor must be"):
        BehaviourRegressor(oblique=wrong).fit(X, y)
