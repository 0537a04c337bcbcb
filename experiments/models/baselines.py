"""Models without hypervectors that learn the same demonstrations, as controllers of the simulator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import sim
from behaviours import Demonstrations
from experiments.models import draws
from experiments.models.fitting import fit_seconds, scaled


def _nearest_neighbour(seed: int) -> Any:
    from sklearn.neighbors import KNeighborsClassifier

    return KNeighborsClassifier(1)


def _decision_tree(seed: int) -> Any:
    from sklearn.tree import DecisionTreeClassifier

    return DecisionTreeClassifier(random_state=seed)


def _mlp(seed: int) -> Any:
    from sklearn.neural_network import MLPClassifier

    # Behaviour cloning. The looser tolerance ends it after 37 instead of 183 epochs of the corral's 60 demonstrations.
    return scaled(MLPClassifier((64,), tol=1e-3, random_state=seed))


CLASSIFIERS: dict[str, Callable[[int], Any]] = {
    "nearest_neighbour": _nearest_neighbour,
    "decision_tree": _decision_tree,
    "mlp": _mlp,
}
"""scikit-learn's classifiers, made with a seed. What makes one imports it, for that takes a second."""


class Classified:
    """A scikit-learn classifier over the distinct commands, as a controller."""

    def __init__(self, model: Any, train: Demonstrations) -> None:
        commands, labels = np.unique(train.commands.numpy(), axis=0, return_inverse=True)
        self.commands: NDArray[np.float64] = commands
        fit_seconds(model, train.sensors.numpy(), labels.ravel())
        self.model = model

    def __call__(self, sensors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Commands `[B, 2]` for readings `[B, 3]`."""
        return self.commands[np.asarray(self.model.predict(sensors), dtype=np.int64)]


class RandomCommands:
    """Both wheels uniform in [-1, 1] at every step, drawn from (seed, episode): the same in any batch."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def start(self, episodes: NDArray[np.int64]) -> draws.Drawn:
        """See `sim.Controller`."""
        return draws.start([(self.seed, episode) for episode in episodes.tolist()], _uniform)

    def step(self, readings: NDArray[np.float64], state: draws.Drawn) -> tuple[NDArray[np.float64], draws.Drawn]:
        """Commands `[B, 2]`, whatever the readings."""
        return draws.step(state, _uniform)


def _uniform(generator: np.random.Generator, rows: int) -> NDArray[np.float64]:
    return generator.uniform(-1, 1, (rows, len(sim.ACTUATORS)))
