"""Real data: which command a robot that follows a wall gave, from its 24, 4 or 2 distances.

Each model learns four of five parts of the rows and is asked about the fifth. Stratified parts are drawn at random,
so that a row's neighbours in time are known; blocks are stretches of time, and tell how a model does on its way.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.progress import Progress
from sklearn.ensemble import RandomForestClassifier
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV, KFold, StratifiedKFold
from sklearn.neighbors import KNeighborsClassifier
from sklearn.neural_network import MLPClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier

from behaviours import BehaviourClassifier
from behaviours.data import load_wall_following
from experiments.choices import check_chosen
from experiments.jobs import run_jobs
from experiments.models import torchhd as torchhd_classifiers
from experiments.models.torchhd import TorchHD
from experiments.results import Row

FOLDS = 5
Fold = tuple[NDArray[np.int64], NDArray[np.int64]]


def stratified(labels: NDArray[Any]) -> list[Fold]:
    """Rows to train on and to test on, five times: shuffled with seed 0, each class spread evenly over the folds."""
    return list(StratifiedKFold(FOLDS, shuffle=True, random_state=0).split(labels, labels))


def blocks(labels: NDArray[Any]) -> list[Fold]:
    """The same for five stretches of time that follow one another; the first are longer by a row where need be."""
    rows = np.arange(len(labels))
    return [(np.setdiff1d(rows, test), test) for test in np.array_split(rows, FOLDS)]


SPLITS: dict[str, Callable[[NDArray[Any]], list[Fold]]] = {"stratified": stratified, "blocks": blocks}


def _scaled(model: Any) -> Any:
    """In units of the training rows' standard deviations, where a model compares or weighs features."""
    return make_pipeline(StandardScaler(), model)


def _torchhd(name: str) -> Callable[[Mapping[str, Any], int], Any]:
    return lambda config, seed: _scaled(TorchHD(name, config["dim"], config["torchhd_epochs"], seed))


MODELS: dict[str, Callable[[Mapping[str, Any], int], Any]] = {
    # All of its settings but these two are the defaults of the library.
    "one_hypervector": lambda config, seed: BehaviourClassifier(dim=config["dim"], random_state=seed),
    # The same with one of its settings chosen anew inside the training rows of every fold, in three stretches of them.
    "one_hypervector_chosen": lambda config, seed: GridSearchCV(
        BehaviourClassifier(dim=config["dim"], random_state=seed), {"subset": [1, 2, 3]}, cv=KFold(3)
    ),
    "decision_tree": lambda config, seed: DecisionTreeClassifier(random_state=seed),
    "random_forest": lambda config, seed: RandomForestClassifier(100, random_state=seed),
    "nearest_neighbour": lambda config, seed: _scaled(KNeighborsClassifier(1)),
    "mlp": lambda config, seed: _scaled(MLPClassifier(hidden_layer_sizes=(64,), max_iter=500, random_state=seed)),
    "logistic_regression": lambda config, seed: _scaled(LogisticRegression(max_iter=2000)),
    "torchhd_vanilla": _torchhd("Vanilla"),
    "torchhd_adapthd": _torchhd("AdaptHD"),
    "torchhd_onlinehd": _torchhd("OnlineHD"),
    "torchhd_lehdc": _torchhd("LeHDC"),
}
"""Name -> a fresh model for (settings, seed)."""

_data = cache(load_wall_following)
"""A worker fits many models to the same rows, and reading them takes as long as some of the fits."""

_SLOWEST = ("one_hypervector_chosen", "torchhd_lehdc", "torchhd_adapthd", "one_hypervector", "mlp")
"""These are started first, so that no worker is left with a long one at the end."""


def check(config: Mapping[str, Any]) -> None:
    """Raise, naming the setting, for what is not there."""
    choices_of = {"models": MODELS, "stratified_only": MODELS, "splits": SPLITS, "sensors": (24, 4, 2)}
    for setting, choices in choices_of.items():
        check_chosen(f"wall_following.{setting}", config[setting], choices, empty=setting == "stratified_only")
    if config["torchhd_epochs"] is not None and config["torchhd_epochs"] < 1:
        raise ValueError(f"wall_following.torchhd_epochs={config['torchhd_epochs']}: expected 1 or more, or null")


def left_out(config: Mapping[str, Any]) -> list[str]:
    """The models that are asked for but cannot be had: those of torch-hd, where it is not installed."""
    return [name for name in config["models"] if name.startswith("torchhd") and not torchhd_classifiers.installed()]


def run(config: Mapping[str, Any], executor: Executor, progress: Progress) -> list[Row]:
    """One record for each model, number of sensors, split and fold; `config` is that of the whole run."""
    own, gone = config["wall_following"], left_out(config["wall_following"])
    order = {name: place for place, name in enumerate(_SLOWEST)}
    jobs = [
        (own, name, sensors, split, fold, config["seed"])
        for name in sorted((m for m in own["models"] if m not in gone), key=lambda m: order.get(m, len(order)))
        for sensors in own["sensors"]
        for split in own["splits"]
        if split == "stratified" or name not in own["stratified_only"]
        for fold in range(FOLDS)
    ]
    return run_jobs(executor, progress, "wall following: models", fit_and_ask, jobs)


def fit_and_ask(config: Mapping[str, Any], model: str, sensors: int, split: str, fold: int, seed: int) -> Row:
    """Fit a model to the training rows of one fold, and ask it about the rest."""
    readings, labels = _data(sensors)
    train, test = SPLITS[split](labels)[fold]
    made = MODELS[model](config, seed)
    began = time.perf_counter()
    with warnings.catch_warnings():
        # A model that would have gone on learning is judged as it is.
        warnings.simplefilter("ignore", ConvergenceWarning)
        made.fit(readings[train], labels[train])
    seconds = time.perf_counter() - began
    accuracy = float((made.predict(readings[test]) == labels[test]).mean())
    return {
        "model": model,
        "sensors": sensors,
        "split": split,
        "fold": fold,
        "rows": len(test),
        "accuracy": accuracy,
        "fit_s": seconds,
    }


def table(records: Sequence[Row], models: Sequence[str]) -> list[Row]:
    """One row for each model, number of sensors and split: the mean over the folds, and the time of all five fits."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for record in records:
        groups.setdefault((record["model"], record["sensors"], record["split"]), []).append(record)
    rows = []
    for (model, sensors, split), own in groups.items():
        accuracies = [record["accuracy"] for record in own]
        rows.append(
            {
                "model": model,
                "sensors": sensors,
                "split": split,
                "accuracy": float(np.mean(accuracies)),
                "accuracy_min": min(accuracies),
                "accuracy_max": max(accuracies),
                "fit_s": sum(record["fit_s"] for record in own),
            }
        )
    return sorted(rows, key=lambda row: (list(models).index(row["model"]), -row["sensors"], row["split"] == "blocks"))
