"""Sample weights, held-back rows and checked parameters of the estimators."""

from typing import Any

import numpy as np
import pytest
import torch
from robots import random_pairs, space
from sklearn.datasets import load_digits, load_iris
from sklearn.utils.estimator_checks import check_param_validation

from behaviours import BehaviourClassifier, BehaviourRegressor, Gradient, quantile_edges
from behaviours.learning.ridge import solve
from torchvsa import MAP

RNG = np.random.default_rng(0)
X = RNG.normal(size=(80, 3)).round(1)
LABELS = np.array(["go", "stop", "turn"])[(X[:, 0] > 0).astype(int) + (X[:, 2] > 0.5)]
VALUES = X[:, :2] @ [[2.0, 1.0], [0.0, -1.0]] + 1


def classifier(**options: Any) -> BehaviourClassifier:
    return BehaviourClassifier(**{"dim": 300, "epochs": 5, "random_state": 0} | options)


def regressor(**options: Any) -> BehaviourRegressor:
    return BehaviourRegressor(**{"dim": 300, "random_state": 0} | options)


@pytest.mark.parametrize("kind", ["classifier", "regressor"])
def test_a_weight_is_a_number_of_rows(kind: str) -> None:
    model, target = (classifier, LABELS) if kind == "classifier" else (regressor, VALUES)
    weights = RNG.integers(0, 4, len(X))
    again, order = np.repeat(np.arange(len(X)), weights), RNG.permutation(weights.sum())
    weighted = model().fit(X, target, sample_weight=weights)
    repeated = model().fit(X[again][order], target[again][order])
    np.testing.assert_array_equal(weighted.predict(X), repeated.predict(X))
    if isinstance(weighted, BehaviourClassifier):
        assert isinstance(repeated, BehaviourClassifier)
        np.testing.assert_array_equal(weighted.decision_function(X), repeated.decision_function(X))
        first = classifier().partial_fit(X, target, np.unique(target), weights)
        second = classifier().partial_fit(X[again], target[again], np.unique(target))
        np.testing.assert_array_equal(first.decision_function(X), second.decision_function(X))
        assert repeated.behaviour_.report.samples == weights.sum()


def test_the_heavier_label_wins_where_labels_contradict() -> None:
    rows, labels = np.r_[X, X], np.r_[np.zeros(80), np.ones(80)]
    for heavy in (0, 1):
        weights = np.where(labels == heavy, 5.0, 0.1)
        model = classifier(epochs=20).fit(rows, labels, sample_weight=weights)
        assert (model.predict(X) == heavy).mean() > 0.9
        regression = regressor().fit(rows, labels, sample_weight=weights)
        np.testing.assert_allclose(regression.predict(X), heavy, atol=0.05)


def test_a_weighted_regression_solves_its_normal_equations() -> None:
    rng = np.random.default_rng(1)
    conditions = torch.from_numpy(rng.choice([-1, 1], (30, 64))).to(torch.int8)
    roles = torch.from_numpy(rng.choice([-1, 1], (2, 64))).to(torch.int8)
    targets, weights = torch.from_numpy(rng.normal(size=(30, 2))), torch.from_numpy(rng.uniform(0.1, 3, 30))
    for count in (30, 40):  # fewer equations than unknowns, and more
        c, t, w = conditions.repeat(2, 1)[:count], targets.repeat(2, 1)[:count], weights.repeat(2)[:count]
        program = solve(MAP(64, dtype=torch.int8), c, roles, t, 0.1, w).double().numpy()
        pairs = (c[:, None] * roles).flatten(0, 1).numpy().astype(float)
        scale = np.repeat(w.numpy(), 2)
        system = pairs.T @ (scale[:, None] * pairs)
        expected = np.linalg.solve(system + 0.1 * 64 * np.eye(64), pairs.T @ (scale * t.numpy().ravel()))
        np.testing.assert_allclose(program, expected, rtol=1e-4, atol=1e-5)


def test_edges_of_weights_that_are_not_whole() -> None:
    readings = torch.tensor([0.0, 1.0, 2.0, 3.0])
    whole = quantile_edges(readings, 16, torch.tensor([3.0, 1, 1, 1]))
    assert torch.equal(quantile_edges(readings, 16, torch.tensor([0.3, 0.1, 0.1, 0.1])), whole)
    assert torch.equal(quantile_edges([0, 0, 0, 1, 2, 3], 16), whole)


@pytest.mark.parametrize(
    ("weights", "words"),
    [
        (np.full(80, -1.0), "Negative values in data passed to `sample_weight`"),
        (np.zeros(80), "[Ss]ample weights must contain at least one non-zero number"),
        (np.ones(79), "sample_weight.shape"),
        (np.full(80, np.nan), "NaN"),
    ],
)
def test_wrong_weights_are_named(weights: Any, words: str) -> None:
    for model, target in ((classifier(), LABELS), (regressor(), VALUES)):
        with pytest.raises(ValueError, match=words):
            model.fit(X, target, sample_weight=weights)
    with pytest.raises(ValueError, match="a classifier needs at least 2 classes"):
        classifier().fit(X, LABELS, sample_weight=(LABELS == "go").astype(float))


@pytest.mark.filterwarnings("ignore::behaviours.ConvergenceWarning")
def test_the_rules_weights_are_checked_and_only_ratios_matter() -> None:
    shown, made = random_pairs(20), space(200)
    weights = torch.arange(1, 21).double()
    rule = Gradient(epochs=4)
    one, two = (rule.fit(made, shown, weights=scale * weights) for scale in (1, 4))
    assert torch.equal(one.program, two.program)
    assert not torch.equal(one.program, rule.fit(made, shown).program)
    assert torch.equal(rule.fit(made, shown, weights=torch.ones(20)).program, rule.fit(made, shown).program)
    for wrong in (weights[:5], weights - 1, weights * torch.inf):
        with pytest.raises(ValueError, match="weights are one positive, finite number per row"):
            rule.fit(made, shown, weights=wrong)


def test_training_stops_when_held_back_rows_do_not_improve() -> None:
    rows, labels = load_digits(n_class=4, return_X_y=True)
    options: Any = {"dim": 500, "random_state": 0, "epochs": 60, "batch_size": 128, "validation_fraction": 0.2}
    model = BehaviourClassifier(**options, patience=3).fit(rows[:400], labels[:400])
    assert 4 <= model.behaviour_.report.epochs < 30
    longer = BehaviourClassifier(**options, patience=60).fit(rows[:400], labels[:400])
    assert longer.behaviour_.report.epochs == 60
    assert 0.8 < model.score(rows[400:], labels[400:]) < longer.score(rows[400:], labels[400:])
    with pytest.raises(ValueError, match=r"validation_fraction=0.999 of .* conditions leaves none to train on"):
        BehaviourClassifier(dim=100, validation_fraction=0.999).fit(rows[:400], labels[:400])


@pytest.mark.parametrize("model", [classifier(), regressor()], ids=["classifier", "regressor"])
def test_scikit_learns_check_of_parameters(model: Any) -> None:
    check_param_validation(type(model).__name__, model)


def test_defaults_take_few_seconds_and_generalise() -> None:
    rows, labels = load_iris(return_X_y=True)
    order = np.random.default_rng(0).permutation(150)
    model = BehaviourClassifier(random_state=0).fit(rows[order[:100]], labels[order[:100]])
    assert model.score(rows[order[100:]], labels[order[100:]]) >= 0.94
