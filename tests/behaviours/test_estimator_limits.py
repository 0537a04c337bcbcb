"""The estimators with values at the ends of the floats, parameters that cannot work, and fits that fail."""

import math
import resource
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
from sklearn.model_selection import GridSearchCV

from behaviours import BehaviourClassifier, BehaviourRegressor

RNG = np.random.default_rng(0)
X = RNG.normal(size=(60, 3))
LABELS = (X[:, 0] > 0).astype(int)
VALUES = X[:, 0] * 2 + 1


def classifier(**options: Any) -> BehaviourClassifier:
    return BehaviourClassifier(**{"dim": 300, "epochs": 5, "random_state": 0} | options)


def regressor(**options: Any) -> BehaviourRegressor:
    return BehaviourRegressor(**{"dim": 300, "random_state": 0} | options)


@pytest.mark.parametrize("value", [1e16, -1e17, 1e300, 1.7e308, -1.7976931348623157e308, 1e-320])
def test_constant_features_of_any_size(value: float) -> None:
    # A constant tells nothing, whatever it is.
    constant, ones = (np.c_[X, np.full(60, each)] for each in (value, 1.0))
    answers = classifier().fit(ones, LABELS).decision_function(ones)
    np.testing.assert_array_equal(classifier().fit(constant, LABELS).decision_function(constant), answers)
    answers = regressor().fit(ones, VALUES).predict(ones)
    np.testing.assert_array_equal(regressor().fit(constant, VALUES).predict(constant), answers)
    alone = np.full((60, 1), value)
    assert set(classifier().fit(alone, LABELS).predict(alone)) <= {0, 1}
    np.testing.assert_allclose(regressor().fit(alone, VALUES).predict(alone), VALUES.mean(), atol=1e-6)


@pytest.mark.parametrize("size", [1e-320, 1e-310, 1e-160, 1e-122, 1e122, 1e155, 1e300, 2e307])
def test_targets_of_any_size(size: float) -> None:
    expected = regressor().fit(X, VALUES).predict(X)
    given = VALUES * size
    assert np.isfinite(given).all()
    model = regressor().fit(X, given)
    np.testing.assert_allclose(model.predict(X), expected * size, rtol=1e-3, atol=5e-323)
    assert np.isfinite(model.mean_).all()
    assert np.isfinite(model.scale_).all()


@pytest.mark.parametrize("value", [1e308, -1.7976931348623157e308, 1e-320, 0.0])
def test_constant_targets(value: float) -> None:
    np.testing.assert_allclose(regressor().fit(X, np.full(60, value)).predict(X), value, rtol=1e-12)


def test_targets_that_span_the_floats() -> None:
    signs = np.where(LABELS, 1.0, -1.0)
    answers = regressor().fit(X, signs * 1.7e308).predict(X)
    assert np.isfinite(answers).all()
    assert (np.sign(answers) == signs).mean() > 0.9


def test_each_output_has_its_own_size() -> None:
    both = np.stack([VALUES * 1e300, VALUES], 1)
    model = regressor(dim=1000).fit(X, both)
    assert model.predict(X).shape == (60, 2)
    np.testing.assert_allclose(model.predict(X)[:, 0] / 1e300, VALUES, atol=1.0)


@pytest.mark.parametrize("model", [classifier(), regressor()], ids=["classifier", "regressor"])
def test_features_that_span_the_floats(model: Any) -> None:
    spread = X.copy()
    spread[:2, 0] = 1.7e308, -1.7e308
    with pytest.raises(ValueError, match=r"sensor 'x0' needs a finite range .* got \[-1.7e\+308, 1.7e\+308\]"):
        model.fit(spread, LABELS)
    for size in (1e-320, 1e-300, 1e300):
        assert np.isfinite(model.fit(X * size, LABELS).predict(X * size)).all()


NOT_WHOLE = [0, -1, 2.5, 2.0, math.nan, "3", None, True]
NOT_POSITIVE = [0, -1, math.nan, math.inf, 10**400, "x", None, 1j, True]
MODELS = (classifier, regressor)
PARAMETERS = (
    [
        (model, name, value)
        for model in (classifier, regressor)
        for name in ("dim", "bins", "subset")
        for value in NOT_WHOLE
    ]
    + [(classifier, name, value) for name in ("epochs", "batch_size") for value in NOT_WHOLE]
    + [(classifier, "patience", value) for value in NOT_WHOLE]
    + [(classifier, "learning_rate", value) for value in NOT_POSITIVE]
    + [(classifier, "validation_fraction", value) for value in (-0.1, 1, math.nan, "x", None)]
    + [(regressor, "ridge", value) for value in NOT_POSITIVE if value is not None]
    + [(model, "verbose", value) for model in MODELS for value in (-1, 0.5, "yes", None)]
    + [(model, "random_state", value) for model in MODELS for value in (-1, 2**32, "a", 1.5)]
)


@pytest.mark.parametrize(("model", "name", "value"), PARAMETERS)
def test_parameters_that_cannot_work_are_named(model: Any, name: str, value: Any) -> None:
    made = model(**{name: value})
    for fit in (made.fit, made.partial_fit) if model is classifier else (made.fit,):
        # Before any work: not even the data are looked at.
        with pytest.raises(ValueError, match=f"^(The '{name}' parameter of Behaviour.* must be |{name} is )") as caught:
            fit([["not", "looked", "at"]], [0])
        assert "\n" not in str(caught.value)


def test_parameters_that_turn_out_too_small_or_large() -> None:
    twice = np.r_[X, X]
    with pytest.raises(ValueError, match="ridge=1e-300 is too small"):
        regressor(ridge=1e-300).fit(twice, np.r_[VALUES, VALUES + 1])
    with pytest.raises(ValueError, match=r"learning_rate=9e\+29 made the program infinite; take a lower one"):
        classifier(learning_rate=9e29).fit(X, LABELS)
    with pytest.raises(ValueError, match="learning_rate"):
        classifier(learning_rate=1e300).fit(X, LABELS)
    answers = regressor(ridge=1e300).fit(X, VALUES).predict(X)
    np.testing.assert_allclose(answers, VALUES.mean())


def test_integers_of_numpy_are_integers() -> None:
    options = {"dim": 300, "bins": 16, "subset": 2}
    whole = {name: np.int64(value) for name, value in options.items()}
    trained = {"epochs": 5, "batch_size": 32}
    one = classifier(**options, **trained).fit(X, LABELS)
    two = classifier(**whole, **{name: np.int32(value) for name, value in trained.items()}).fit(X, LABELS)
    np.testing.assert_array_equal(one.decision_function(X), two.decision_function(X))
    np.testing.assert_array_equal(
        regressor(**options).fit(X, VALUES).predict(X), regressor(**whole).fit(X, VALUES).predict(X)
    )
    sizes = {"dim": np.arange(100, 300, 100)}
    grid = GridSearchCV(classifier(), sizes, cv=2, error_score=cast(Any, "raise")).fit(X, LABELS)
    assert grid.best_params_["dim"] in (100, 200)


@pytest.mark.parametrize("model", [classifier, regressor])
def test_bins_that_no_memory_holds(model: Any) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ValueError, match=r"bins=1,000,000,000,000 for each of 3 features needs 72 TB of memory"):
        model(bins=10**12).fit(X, LABELS)
    # In units of 1,024 bytes: nothing was taken on the way there.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


def state(model: Any) -> dict[str, Any]:
    return dict(vars(model))


def same(before: dict[str, Any], after: dict[str, Any]) -> bool:
    return before.keys() == after.keys() and all(before[name] is after[name] for name in before)


BLIND = np.full((60, 3), np.nan)
FAILURES = {
    "blind rows": (BLIND, LABELS),
    "infinite values": (X * math.inf, LABELS),
    "one class": (X, np.zeros(60)),
    "other columns and rows without a value": (np.full((60, 2), np.nan), LABELS),
    "span of the floats": (np.where(LABELS[:, None], 1.7e308, -1.7e308) * np.ones(3), LABELS),
    "named columns": (pd.DataFrame(BLIND, columns=["a", "b", "c"]), LABELS),
}


@pytest.mark.parametrize("case", FAILURES)
def test_a_failed_fit_leaves_the_classifier_as_it_was(case: str) -> None:
    rows, labels = FAILURES[case]
    new = classifier()
    before = state(new)
    with pytest.raises(ValueError, match=r"."):
        new.fit(rows, labels)
    assert same(before, state(new))
    fitted = classifier().fit(X, np.array(["go", "stop", "turn"])[np.arange(60) % 3])
    before, answers = state(fitted), fitted.predict(X)
    with pytest.raises(ValueError, match=r"."):
        fitted.fit(rows, labels)
    assert same(before, state(fitted))
    np.testing.assert_array_equal(fitted.predict(X), answers)


@pytest.mark.parametrize("case", [case for case in FAILURES if case != "one class"])
def test_a_failed_fit_leaves_the_regressor_as_it_was(case: str) -> None:
    rows, values = FAILURES[case]
    new = regressor()
    before = state(new)
    with pytest.raises(ValueError, match=r"."):
        new.fit(rows, values)
    assert same(before, state(new))
    fitted = regressor().fit(X, np.stack([VALUES, -VALUES], 1))
    before, answers = state(fitted), fitted.predict(X)
    with pytest.raises(ValueError, match=r"."):
        fitted.fit(rows, values)
    assert same(before, state(fitted))
    np.testing.assert_array_equal(fitted.predict(X), answers)


@pytest.mark.parametrize("case", [case for case in FAILURES if case != "one class"])
def test_a_failed_first_batch_leaves_nothing_behind(case: str) -> None:
    rows, labels = FAILURES[case]
    model, fresh = classifier(), classifier()
    before = state(model)
    with pytest.raises(ValueError, match=r"."):
        model.partial_fit(rows, labels, classes=[0, 1])
    assert same(before, state(model))
    for made in (model, fresh):
        made.partial_fit(X, LABELS, classes=[0, 1])
    np.testing.assert_array_equal(model.decision_function(X), fresh.decision_function(X))
    before = state(model)
    with pytest.raises(ValueError, match=r"."):
        model.partial_fit(BLIND, LABELS)
    with pytest.raises(ValueError, match="none of the classes"):
        model.partial_fit(X, LABELS + 5)
    assert same(before, state(model))


def test_the_share_done_is_printed_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    classifier().fit(X, LABELS).partial_fit(X, LABELS)
    regressor().fit(X, VALUES)
    assert capsys.readouterr().out == ""
    loud = classifier(verbose=1, epochs=40).fit(X, LABELS)
    lines = capsys.readouterr().out.splitlines()
    assert 2 <= len(lines) <= 11
    assert lines[-1] == "[BehaviourClassifier] 100% done"
    loud.partial_fit(X, LABELS)
    assert capsys.readouterr().out.splitlines()[-1] == "[BehaviourClassifier] 100% done"
    regressor(verbose=True).fit(X, VALUES)
    assert capsys.readouterr().out.splitlines() == ["[BehaviourRegressor] 50% done", "[BehaviourRegressor] 100% done"]
    np.testing.assert_array_equal(
        loud.fit(X, LABELS).decision_function(X), classifier(epochs=40).fit(X, LABELS).decision_function(X)
    )
