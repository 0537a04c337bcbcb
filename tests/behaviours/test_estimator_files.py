"""Files of estimators: every answer and label comes back, no pickles, and bad files are refused by name."""

import json
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
from safetensors import safe_open
from sklearn.exceptions import NotFittedError

from behaviours import BehaviourBank, BehaviourClassifier, BehaviourRegressor
from behaviours.storage import load_tensors, save_tensors

RNG = np.random.default_rng(0)
X = RNG.normal(size=(90, 3))
X[::9, 1] = math.nan
CLASS = (X[:, 0] > 0).astype(int) + (X[:, 2] > 0.5)
LABELS: dict[str, Any] = {
    "strings": np.array(["go", "stop", "turn left"])[CLASS],
    "objects": np.array(["go", "stop", "turn left"], dtype=object)[CLASS],
    "numbers": np.array([-3, 7, 2**40])[CLASS],
    "bytes": CLASS.astype(np.uint8),
    "floats": np.array([0.0, 1.0, 3.0])[CLASS],
    "booleans": CLASS > 0,
}


def classifier(**options: Any) -> BehaviourClassifier:
    return BehaviourClassifier(**{"dim": 200, "epochs": 3, "random_state": 0} | options)


def regressor(**options: Any) -> BehaviourRegressor:
    return BehaviourRegressor(**{"dim": 200, "random_state": 0} | options)


@pytest.mark.parametrize("kind", LABELS)
def test_a_classifier_comes_back_with_its_labels(tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    model = classifier(dim=np.int64(200), validation_fraction=0.2).fit(X, LABELS[kind])
    path = model.save(tmp_path / "model.safetensors")
    monkeypatch.setattr(pickle, "loads", None)
    again = BehaviourClassifier.load(path)
    assert again.classes_.dtype == model.classes_.dtype
    np.testing.assert_array_equal(again.predict(X), model.predict(X))
    np.testing.assert_array_equal(again.decision_function(X), model.decision_function(X))
    assert again.get_params() == model.get_params()
    assert again.behaviour_.report == model.behaviour_.report
    assert again.save(tmp_path / "again.safetensors").read_bytes() == path.read_bytes()
    # It goes on as the one that was saved.
    np.testing.assert_array_equal(
        again.partial_fit(X, LABELS[kind]).decision_function(X), model.partial_fit(X, LABELS[kind]).decision_function(X)
    )


@pytest.mark.parametrize("outputs", [1, 2])
def test_a_regressor_comes_back_with_its_columns(tmp_path: Path, outputs: int) -> None:
    frame = pd.DataFrame(X, columns=["front", "left", "right"])
    values = X[:, 0] * 1e6 if outputs == 1 else X[:, [0, 2]] * [1.0, 1e-9]
    model = regressor(ridge=0.5).fit(frame, values)
    again = BehaviourRegressor.load(model.save(tmp_path / "model"))
    np.testing.assert_array_equal(again.predict(frame), model.predict(frame))
    assert again.predict(frame).shape == values.shape
    assert again.get_params() == model.get_params()
    assert again.feature_names_in_.tolist() == ["front", "left", "right"]
    with pytest.raises(ValueError, match="feature names should match"):
        again.predict(frame[["left", "front", "right"]])


def test_the_labels_are_readable_without_this_library(tmp_path: Path) -> None:
    path = classifier().fit(X, LABELS["strings"]).save(tmp_path / "model.safetensors")
    with safe_open(path, "numpy") as file:
        about = json.loads(file.metadata()["torchvsa"])["about"]
        assert file.get_tensor("program").shape == (200,)
    assert about["classes"]["values"] == ["go", "stop", "turn left"]


def test_what_no_file_can_hold(tmp_path: Path) -> None:
    for model in (classifier(), regressor()):
        with pytest.raises(NotFittedError):
            model.save(tmp_path / "model")
    model = classifier(random_state=np.random.RandomState(0)).fit(X, CLASS)
    with pytest.raises(ValueError, match="random_state is a generator"):
        model.save(tmp_path / "model")
    model.set_params(random_state=None).save(tmp_path / "model")
    with pytest.raises(ValueError, match="the file holds 'BehaviourClassifier', not 'BehaviourRegressor'"):
        BehaviourRegressor.load(tmp_path / "model")
    with pytest.raises(ValueError, match="the file holds 'BehaviourClassifier', not 'bank'"):
        BehaviourBank.load(tmp_path / "model")


def _set(about: Any, *keys: str, value: Any) -> None:
    for key in keys[:-1]:
        about = about[key]
    about[keys[-1]] = value


CHANGES: dict[str, tuple[Callable[[Any, Any], object], str]] = {
    "labels": (lambda _, about: _set(about, "classes", "values", value=[0, 0, 2]), "labels must be"),
    "fewer labels": (lambda _, about: _set(about, "classes", "values", value=[0, 1]), "do not match the 2 classes"),
    "objects": (lambda _, about: _set(about, "classes", value={"dtype": "O", "values": [1, [2]]}), "not strings"),
    "parameter": (lambda _, about: _set(about, "parameters", "dim", value=-1), "parameters: The 'dim' parameter"),
    "other parameter": (lambda _, about: _set(about, "parameters", "dimension", value=1), "parameters: .*dimension"),
    "names": (lambda _, about: _set(about, "features", value=["one"]), "features must be 3 names"),
    "program": (lambda tensors, _: tensors.update(program=tensors["program"][:9].clone()), "program must be one"),
    "codebook": (
        lambda tensors, _: tensors.pop("space.result_encoder.roles"),
        "'space.result_encoder.roles' is missing",
    ),
    "more": (lambda tensors, _: tensors.update(more=tensors["program"].clone()), "'more' is unexpected"),
    "nothing": (lambda tensors, _: tensors.pop("known"), "'known' is missing"),
}


@pytest.mark.parametrize("case", CHANGES)
def test_files_that_do_not_fit_together_are_refused(tmp_path: Path, case: str) -> None:
    change, words = CHANGES[case]
    path = classifier().fit(X, CLASS).save(tmp_path / "model.safetensors")
    tensors, about = load_tensors(path, "BehaviourClassifier")
    change(tensors, about)
    save_tensors(path, "BehaviourClassifier", tensors, about)
    with pytest.raises(ValueError, match=f"model.safetensors does not describe .*{words}") as caught:
        BehaviourClassifier.load(path)
    assert "\n" not in str(caught.value)


def test_a_regressors_tensors_are_checked(tmp_path: Path) -> None:
    path = regressor().fit(X, X[:, 0]).save(tmp_path / "model")
    tensors, about = load_tensors(path, "BehaviourRegressor")
    for name, wrong in (("mean", tensors["mean"].repeat(2)), ("scale", tensors["scale"] / 0), ("program", CLASS)):
        changed = tensors | {name: wrong if not isinstance(wrong, np.ndarray) else tensors["mean"].long()}
        save_tensors(path, "BehaviourRegressor", cast(Any, changed), about)
        with pytest.raises(ValueError, match=f"tensor '{name}' must be finite floats"):
            BehaviourRegressor.load(path)
