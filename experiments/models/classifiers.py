"""Classifiers of rows of readings, with scikit-learn's two verbs: one hypervector, and what it is compared with."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.neighbors import KNeighborsClassifier
from sklearn.neural_network import MLPClassifier
from sklearn.tree import DecisionTreeClassifier

from behaviours import BehaviourClassifier
from experiments.models import torchhd
from experiments.models.fitting import fit_seconds, scaled


def _torchhd(name: str) -> Callable[[int, int | None, int], Any]:
    return lambda dim, epochs, seed: scaled(torchhd.TorchHD(name, dim, epochs, seed))


CLASSIFIERS: dict[str, Callable[[int, int | None, int], Any]] = {
    # All of its settings but these two are the defaults of the library.
    "one_hypervector": lambda dim, epochs, seed: BehaviourClassifier(dim=dim, random_state=seed),
    # The same with one setting chosen inside the training rows of every fold, in three stretches of them.
    "one_hypervector_chosen": lambda dim, epochs, seed: GridSearchCV(
        BehaviourClassifier(dim=dim, random_state=seed), {"subset": [1, 2, 3]}, cv=KFold(3)
    ),
    "decision_tree": lambda dim, epochs, seed: DecisionTreeClassifier(random_state=seed),
    "random_forest": lambda dim, epochs, seed: RandomForestClassifier(100, random_state=seed),
    "nearest_neighbour": lambda dim, epochs, seed: scaled(KNeighborsClassifier(1)),
    "mlp": lambda dim, epochs, seed: scaled(MLPClassifier(hidden_layer_sizes=(64,), max_iter=500, random_state=seed)),
    "logistic_regression": lambda dim, epochs, seed: scaled(LogisticRegression(max_iter=2000)),
    "torchhd_vanilla": _torchhd("Vanilla"),
    "torchhd_adapthd": _torchhd("AdaptHD"),
    "torchhd_onlinehd": _torchhd("OnlineHD"),
    "torchhd_lehdc": _torchhd("LeHDC"),
}
"""Name -> a new model for (dimension, epochs of torch-hd's models, seed); None is torch-hd's default."""

SLOWEST = ("one_hypervector_chosen", "torchhd_lehdc", "torchhd_adapthd", "one_hypervector", "mlp")
"""The models that take longest to fit, the slowest first."""


def not_installed(names: Iterable[str]) -> list[str]:
    """Those of the models that need torch-hd, if it is not installed."""
    return [name for name in names if name.startswith("torchhd") and not torchhd.installed()]


def accuracy(
    model: Any, readings: NDArray[Any], labels: NDArray[Any], fold: tuple[NDArray[np.int64], NDArray[np.int64]]
) -> dict[str, Any]:
    """Fit a model to the training rows of a fold: its `accuracy` on the test `rows`, and the seconds of the fit."""
    train, test = fold
    seconds = fit_seconds(model, readings[train], labels[train])
    correct = model.predict(readings[test]) == labels[test]
    return {"rows": len(test), "accuracy": float(correct.mean()), "fit_s": seconds}
