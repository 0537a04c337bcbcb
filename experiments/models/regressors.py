"""Regressors of commands, with scikit-learn's two verbs, and as controllers of the simulator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import Ridge
from sklearn.neighbors import KNeighborsRegressor
from sklearn.neural_network import MLPRegressor

from behaviours import BehaviourClassifier, BehaviourRegressor
from experiments.models.fitting import fit_seconds, scaled

Floats = NDArray[np.float64]

BASELINES: dict[str, Callable[[int], Any]] = {
    "nearest_neighbours": lambda seed: scaled(KNeighborsRegressor(5)),
    "ridge": lambda seed: scaled(Ridge()),
    "mlp": lambda seed: scaled(MLPRegressor(hidden_layer_sizes=(64,), max_iter=1000, random_state=seed)),
}
"""scikit-learn's regressors, made with a seed."""

OURS, LEVELS = "one_hypervector", "levels"
REGRESSORS = (OURS, LEVELS, *BASELINES)
"""All that `regressor` makes."""

BATCH = 1024
"""Rows per prediction, so that memory stays small."""


class Levels:
    """Commands rounded to `levels` values between -1 and 1, recalled by a clean-up among those that were shown."""

    def __init__(self, levels: int, dim: int, seed: int) -> None:
        self.values = np.linspace(-1, 1, levels)
        self.model = BehaviourClassifier(dim=dim, random_state=seed)

    def rounded(self, commands: Floats) -> Floats:
        """The nearest level of each command."""
        return self.values[np.abs(commands[..., None] - self.values).argmin(-1)]

    def fit(self, X: Floats, y: Floats) -> Levels:  # noqa: N803 (scikit-learn's name)
        """Learn readings `X` `[N, n]` and commands `y` `[N, m]`."""
        self.results, labels = np.unique(self.rounded(y), axis=0, return_inverse=True)
        self.model.fit(X, labels.ravel())
        return self

    def predict(self, X: Floats) -> Floats:  # noqa: N803 (scikit-learn's name)
        """Commands `[B, m]`, each row one of the results that were shown."""
        return self.results[self.model.predict(X)]


class RegressorController:
    """A regressor of commands as a controller of the simulator."""

    def __init__(self, model: Any) -> None:
        self.model = model

    def __call__(self, sensors: Floats, *_: Any) -> Floats:
        """Commands `[B, 2]`, clipped to what the wheels can do."""
        return np.clip(self.model.predict(sensors), -1, 1)


def regressor(name: str, dim: int | None, levels: int | None, seed: int) -> Any:
    """A new model of `REGRESSORS`. Hypervectors need a dimension, and those with a clean-up a number of levels."""
    if name in BASELINES:
        return BASELINES[name](seed)
    if dim is None or (name == LEVELS and levels is None):
        raise ValueError(f"{name} needs a dimension and, for {LEVELS}, levels; got dim={dim}, levels={levels}")
    return BehaviourRegressor(dim=dim, random_state=seed) if levels is None else Levels(levels, dim, seed)


def errors(model: Any, readings: Floats, commands: Floats, new_readings: Floats, target: Floats) -> dict[str, Any]:
    """Fit a model to readings and commands, and compare its commands for new readings with the target.

    The root mean square error (`rmse`), that of always commanding the mean (`mean_rmse`), their ratio (`relative`), for
    `Levels` the error of rounding the target (`rounding_rmse`), and the seconds of the fit (`fit_s`).
    """
    seconds = fit_seconds(model, readings, commands)
    batches = np.array_split(new_readings, -(-len(target) // BATCH))
    predicted = np.concatenate([model.predict(batch) for batch in batches])
    error, mean_error = _rmse(predicted, target), _rmse(commands.mean(0), target)
    found = {"samples": len(target), "rmse": error, "mean_rmse": mean_error, "relative": error / mean_error}
    rounding = {"rounding_rmse": _rmse(model.rounded(target), target)} if isinstance(model, Levels) else {}
    return {**found, **rounding, "fit_s": seconds}


def _rmse(predicted: Floats, target: Floats) -> float:
    return float(np.sqrt(np.mean((predicted - target) ** 2)))
