"""The estimators in scikit-learn's hands, and on real data."""

import builtins
import pickle
import sys
from collections.abc import Iterator
from typing import Any, cast

import numpy as np
import pytest
from sklearn.datasets import load_diabetes, load_iris
from sklearn.model_selection import GridSearchCV, KFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import estimator_checks_generator

import behaviours
from behaviours import BehaviourClassifier, BehaviourRegressor
from behaviours.data import load_wall_following

ESTIMATORS = [BehaviourClassifier(dim=500, epochs=30, random_state=0), BehaviourRegressor(dim=500, random_state=0)]


def checks() -> Iterator[Any]:
    for estimator in ESTIMATORS:
        for ready, check in cast(Iterator[tuple[Any, Any]], estimator_checks_generator(estimator)):
            name = getattr(check, "func", check).__name__
            # Array-API input needs SCIPY_ARRAY_API to be set before anything is imported.
            if name != "check_array_api_input":
                yield pytest.param(ready, check, id=f"{type(ready).__name__}-{name}")


@pytest.mark.filterwarnings("default")  # the checks look for warnings themselves
@pytest.mark.parametrize(("estimator", "check"), list(checks()))
def test_scikit_learns_checks(estimator: Any, check: Any) -> None:
    check(estimator)


def test_iris_in_pipeline_grid_and_folds() -> None:
    X, y = load_iris(return_X_y=True)  # noqa: N806
    folds = KFold(5, shuffle=True, random_state=0)
    model = make_pipeline(StandardScaler(), BehaviourClassifier(dim=1000, epochs=30, random_state=0))
    assert cross_val_score(model, X, y, cv=folds).mean() > 0.92
    grid = GridSearchCV(model, {"behaviourclassifier__subset": [1, 2]}, cv=folds).fit(X, y)
    assert grid.best_score_ > 0.92


def test_diabetes_is_explained_as_well_as_by_a_line() -> None:
    X, y = load_diabetes(return_X_y=True)  # noqa: N806
    folds = KFold(5, shuffle=True, random_state=0)
    assert cross_val_score(BehaviourRegressor(dim=2000, ridge=1, random_state=0), X, y, cv=folds).mean() > 0.4


def test_smooth_values_are_interpolated() -> None:
    angle = np.linspace(0, 6, 200)[:, None]
    values = np.concatenate([np.sin(angle), np.cos(angle)], 1)
    model = BehaviourRegressor(ridge=1e-3, random_state=0).fit(angle[::2], values[::2])
    np.testing.assert_allclose(model.predict(angle[1::2]), values[1::2], atol=0.1)
    assert model.program_.shape == (4000,)


def exclusive_or() -> tuple[np.ndarray, np.ndarray]:
    X = np.random.default_rng(0).uniform(-1, 1, (600, 2))  # noqa: N806
    return X, (X[:, 0] > 0) ^ (X[:, 1] > 0)


def test_one_hypervector_learns_interactions() -> None:
    X, y = exclusive_or()  # noqa: N806
    model = BehaviourClassifier(dim=2000, random_state=0).fit(X[:400], y[:400])
    assert model.score(X[400:], y[400:]) > 0.93
    assert model.behaviour_.program.shape == (2000,)
    apart = BehaviourClassifier(dim=2000, subset=1, oblique=0, random_state=0).fit(X[:400], y[:400])
    assert apart.score(X[400:], y[400:]) < 0.7


def test_probabilities_scores_and_labels_agree() -> None:
    X, y = load_iris(return_X_y=True)  # noqa: N806
    model = BehaviourClassifier(dim=500, epochs=20, random_state=1).fit(X[::-1], np.array(["c", "a", "b"])[y[::-1]])
    proba, scores = model.predict_proba(X), model.decision_function(X)
    np.testing.assert_allclose(proba.sum(1), 1)
    np.testing.assert_array_equal(proba.argmax(1), scores.argmax(1))
    np.testing.assert_array_equal(model.predict(X), model.classes_[proba.argmax(1)])
    assert model.classes_.tolist() == ["a", "b", "c"]
    # The same answers as the behaviour itself gives.
    commands = model.behaviour_(X).commands[:, 0].numpy()
    np.testing.assert_array_equal(model.classes_[commands.astype(int)], model.predict(X))


def test_a_missing_reading_is_left_out_and_a_blind_row_refused() -> None:
    X, y = exclusive_or()  # noqa: N806
    X = np.c_[X, np.full(len(X), np.nan)]  # noqa: N806
    X[::7, 2] = 1.0
    model = BehaviourClassifier(dim=2000, random_state=0).fit(X, y)
    assert model.score(X, y) > 0.95
    X[3] = np.nan
    with pytest.raises(ValueError, match="row 3 has no observed feature"):
        model.predict(X)
    with pytest.raises(ValueError, match="row 3 has no observed feature"):
        model.fit(X, y)


def test_the_seed_decides_and_pickles_keep_it() -> None:
    X, y = load_iris(return_X_y=True)  # noqa: N806
    one, two, three = (BehaviourClassifier(dim=300, epochs=5, random_state=s).fit(X, y) for s in (0, 0, 1))
    np.testing.assert_array_equal(one.predict_proba(X), two.predict_proba(X))
    assert not np.array_equal(one.predict_proba(X), three.predict_proba(X))
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(one)).predict_proba(X), one.predict_proba(X))


def test_batches_are_learned_one_after_the_other() -> None:
    X, y = load_wall_following(4)  # noqa: N806
    order = np.random.default_rng(0).permutation(len(X))
    model = BehaviourClassifier(dim=1000, epochs=5, random_state=0)
    for rows in np.split(order[:4000], 4):
        model.partial_fit(X[rows], y[rows], classes=np.unique(y))
    assert model.score(X[order[4000:]], y[order[4000:]]) > 0.97
    assert model.behaviour_.report.samples == 4000
    assert model.behaviour_.report.epochs == 20


@pytest.mark.parametrize(("rows", "size"), [(100, 16), (640, 40), (1920, 120), (2400, 128)])
def test_few_rows_come_in_small_batches(rows: int, size: int) -> None:
    x = np.random.default_rng(0).normal(size=(rows, 2))
    y = x[:, 0] > 0
    options = {"dim": 100, "bins": 8, "oblique": 0, "epochs": 2, "random_state": 0}
    auto, given = BehaviourClassifier(**options), BehaviourClassifier(**options, batch_size=size)
    np.testing.assert_array_equal(auto.fit(x, y).decision_function(x), given.fit(x, y).decision_function(x))
    # Equal rows count once.
    twice = BehaviourClassifier(**options).fit(np.r_[x, x], np.r_[y, y])
    assert twice.behaviour_.report.updates == given.behaviour_.report.updates
    again = auto.partial_fit(x, y).behaviour_.report.updates
    assert again == 2 * given.behaviour_.report.updates


def test_classes_may_come_later_than_they_are_named() -> None:
    X, y = load_iris(return_X_y=True)  # noqa: N806
    names = np.array(["c", "a", "b"])[y]
    model = BehaviourClassifier(dim=500, epochs=20, random_state=0)
    model.partial_fit(X[:50], names[:50], classes=["a", "b", "c"])
    assert model.classes_.tolist() == ["a", "b", "c"]
    assert model.predict(X[:50]).tolist() == ["c"] * 50
    assert model.predict_proba(X).shape == (150, 3)
    order = np.random.default_rng(0).permutation(150)
    model.partial_fit(X[order], names[order])
    # The bins are those of the first batch, in which one class stood alone.
    assert model.score(X, names) > 0.7
    again = BehaviourClassifier(dim=500, epochs=20, random_state=0).fit(X, names)
    assert again.partial_fit(X[:10], names[:10]).score(X, names) > 0.8
    again.partial_fit(X[:10], names[:10], classes=["c", "a", "b"])


@pytest.mark.parametrize(
    ("labels", "options", "words"),
    [
        ([0, 1], {}, "the first call of partial_fit needs all classes, at least 2; got classes=None"),
        ([0, 0], {"classes": [0]}, "at least 2; got classes=\\[0\\]"),
        ([0, 2], {"classes": [0, 1]}, "y holds .*2.*, which is none of the classes"),
    ],
)
def test_first_batches_that_say_too_little(labels: list[int], options: Any, words: str) -> None:
    model = BehaviourClassifier(dim=100, epochs=1, random_state=0)
    with pytest.raises(ValueError, match=words):
        model.partial_fit([[0.0], [1.0]], labels, **options)


def test_classes_stay_those_of_the_first_call() -> None:
    model = BehaviourClassifier(dim=100, epochs=1, random_state=0).partial_fit([[0.0], [1.0]], [0, 1], classes=[0, 1])
    with pytest.raises(ValueError, match=r"classes are \[0 1\] since the first call; got \[0 1 2\]"):
        model.partial_fit([[0.0]], [0], classes=[0, 1, 2])
    with pytest.raises(ValueError, match="none of the classes"):
        model.partial_fit([[0.0]], [5])


def test_without_scikit_learn_the_rest_works_and_the_error_says_what_to_install(monkeypatch: Any) -> None:
    for module in [name for name in sys.modules if name.startswith("behaviours.estimators")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.delattr(behaviours, "estimators", raising=False)
    real = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.partition(".")[0] == "sklearn":
            raise ModuleNotFoundError("No module named 'sklearn'", name="sklearn")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=r"BehaviourClassifier needs scikit-learn: pip install 'torchvsa\[sklearn\]'"):
        _ = behaviours.BehaviourClassifier
    with pytest.raises(AttributeError, match="no attribute 'BehaviourGuesser'"):
        _ = behaviours.BehaviourGuesser  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize("sensors", [2, 4, 24])
def test_the_wall_following_set(sensors: int) -> None:
    X, y = load_wall_following(sensors)  # noqa: N806
    assert X.shape == (5456, sensors)
    names, counts = np.unique(y, return_counts=True)
    assert dict(zip(names.tolist(), counts.tolist(), strict=True)) == {
        "Move-Forward": 2205,
        "Sharp-Right-Turn": 2097,
        "Slight-Left-Turn": 328,
        "Slight-Right-Turn": 826,
    }
    with pytest.raises(ValueError, match="sensors is 24, 4 or 2; got 3"):
        load_wall_following(3)


@pytest.mark.slow
@pytest.mark.parametrize(("sensors", "at_least"), [(24, 0.96), (2, 0.99)])
def test_a_real_robot_in_stretches_of_time(sensors: int, at_least: float) -> None:
    # Two of the five blocks at fewer dimensions and epochs: the whole table takes minutes.
    X, y = load_wall_following(sensors)  # noqa: N806
    accuracies = []
    for train, test in list(KFold(5).split(X))[2:4]:
        model = BehaviourClassifier(dim=2000, epochs=30, random_state=0).fit(X[train], y[train])
        accuracies.append(model.score(X[test], y[test]))
    assert np.mean(accuracies) >= at_least
