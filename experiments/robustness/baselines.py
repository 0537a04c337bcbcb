"""The learners without hypervectors, an MLP and a decision tree, whose parameters are damaged."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.neural_network import MLPClassifier
from sklearn.tree import DecisionTreeClassifier

import sim
from behaviours import Demonstrations
from experiments.models.damage import Array, Damage, Floats
from experiments.models.fitting import fit_seconds

Parameters = tuple[Floats, NDArray[np.int64] | slice, float]
"""An array of a model, those of its rows that can be damaged, and what they are mirrored in (see `Array`)."""


@dataclass(frozen=True)
class Baseline:
    """A scikit-learn classifier of the readings `(x - shift) / scale`, as a learner that can be damaged.

    `parameters` returns views into a model; what is written there changes it.
    """

    model: Any
    parameters: Callable[[Any], list[Parameters]]
    shift: Floats
    scale: Floats
    commands: Floats

    def __call__(self, sensors: Floats) -> Floats:
        """Commands `[B, 2]` for readings `[B, 3]`."""
        return self.commands[self.model.predict_proba((sensors - self.shift) / self.scale).argmax(-1)]

    def elements(self, part: str) -> int:
        """See `Learner.elements`."""
        return sum(len(array[rows]) for array, rows, _ in self.parameters(self.model))

    def damaged(self, part: str, damage: Damage) -> Baseline:
        """See `Learner.damaged`."""
        model = copy.deepcopy(self.model)
        found = self.parameters(model)
        damaged = damage([Array(array[rows], mirror) for array, rows, mirror in found])
        for (array, rows, _), values in zip(found, damaged, strict=True):
            array[rows] = values
        return replace(self, model=model)


def network(train: Demonstrations, seed: int, hidden: int, epochs: int) -> Baseline:
    """An MLP with one hidden layer on standardised readings; its parameters are all weights and biases.

    Raises `ValueError` if all demonstrations have the same command.
    """
    readings = train.sensors.numpy()
    mean, spread = readings.mean(0), readings.std(0).clip(1e-9)
    commands, labels = np.unique(train.commands.numpy(), axis=0, return_inverse=True)
    if len(commands) < 2:
        raise ValueError("learners: mlp needs demonstrations with two commands or more; show more, or for longer")
    model = MLPClassifier((hidden,), random_state=seed, max_iter=epochs)
    # One unit for every class, also where two would share one.
    fit_seconds(model, (readings - mean) / spread, np.eye(len(commands))[labels.ravel()])
    model.out_activation_ = "identity"  # large outputs, of which damage makes some, would all become 1

    def parameters(model: Any) -> list[Parameters]:
        return [(layer.reshape(-1), slice(None), 0.0) for layer in (*model.coefs_, *model.intercepts_)]

    return Baseline(model, parameters, mean, spread, commands)


def tree(train: Demonstrations, seed: int) -> Baseline:
    """A decision tree; its parameters are the thresholds and the decisions of its leaves.

    A threshold is a position in its sensor's range, from 0 to 1: flipped it is mirrored within the range, zero is the
    low end. A leaf's decision is one element, the scores of its commands (the shares of its samples): flipped they are
    negated, so that another command wins; without any score the first command does.
    """
    low, high = np.array([(sensor.low, sensor.high) for sensor in sim.SENSORS]).T
    commands, labels = np.unique(train.commands.numpy(), axis=0, return_inverse=True)
    model = DecisionTreeClassifier(random_state=seed)
    model.fit((train.sensors.numpy() - low) / (high - low), labels.ravel())
    children = model.tree_.children_left
    inner, leaves = np.flatnonzero(children >= 0), np.flatnonzero(children < 0)

    def parameters(model: Any) -> list[Parameters]:
        return [(model.tree_.threshold, inner, 1.0), (model.tree_.value[:, 0], leaves, 0.0)]

    return Baseline(model, parameters, low, high - low, commands)
