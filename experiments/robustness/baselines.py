"""The learners without hypervectors, an MLP and a decision tree, whose parameters are damaged."""

import copy
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier
from sklearn.tree import DecisionTreeClassifier

import sim
from behaviours import Demonstrations
from experiments.robustness.damage import Array, Damage, Floats


class Network:
    """An MLP with one hidden layer on standardised readings; its parameters are all weights and biases."""

    def __init__(self, train: Demonstrations, seed: int, hidden: int, epochs: int) -> None:
        readings = train.sensors.numpy()
        self.mean, self.scale = readings.mean(0), readings.std(0).clip(1e-9)
        self.classes, labels = np.unique(train.commands.numpy(), axis=0, return_inverse=True)
        self.model = MLPClassifier((hidden,), random_state=seed, max_iter=epochs)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # the epochs are a setting
            # One unit for every class, also where two would share one.
            targets = np.eye(len(self.classes))[labels.ravel()]
            self.model.fit((readings - self.mean) / self.scale, targets)
        self.layers = [*self.model.coefs_, *self.model.intercepts_]

    def elements(self, part: str) -> int:
        """See `Learner.elements`."""
        return sum(layer.size for layer in self.layers)

    def damaged(self, part: str, damage: Damage) -> "DamagedNetwork":
        """See `Learner.damaged`."""
        values = damage([Array(layer.ravel()) for layer in self.layers])
        layers = [value.reshape(layer.shape) for value, layer in zip(values, self.layers, strict=True)]
        return DamagedNetwork(self.mean, self.scale, layers, self.classes)


@dataclass(frozen=True)
class DamagedNetwork:
    """The same computation with other weights."""

    mean: Floats
    scale: Floats
    layers: list[Floats]
    classes: Floats

    def __call__(self, sensors: Floats) -> Floats:
        """Commands `[B, 2]` for readings `[B, 3]`."""
        weights_in, weights_out, bias_in, bias_out = self.layers
        hidden = np.maximum((sensors - self.mean) / self.scale @ weights_in + bias_in, 0.0)
        return self.classes[(hidden @ weights_out + bias_out).argmax(-1)]


class Tree:
    """A decision tree; its parameters are the thresholds and the decisions of its leaves.

    A threshold is a position in its sensor's range, from 0 to 1: flipped it is mirrored within the range, zero is the
    low end. A leaf's decision is one element, the scores of its commands (the shares of its samples): flipped they are
    negated, so that another command wins; without any score the first command does.
    """

    def __init__(self, train: Demonstrations, seed: int) -> None:
        self.classes, labels = np.unique(train.commands.numpy(), axis=0, return_inverse=True)
        self.model = DecisionTreeClassifier(random_state=seed).fit(positions(train.sensors.numpy()), labels.ravel())
        children = self.model.tree_.children_left
        self.inner, self.leaves = np.flatnonzero(children >= 0), np.flatnonzero(children < 0)

    def elements(self, part: str) -> int:
        """See `Learner.elements`."""
        return len(self.inner) + len(self.leaves)

    def damaged(self, part: str, damage: Damage) -> "DamagedTree":
        """See `Learner.damaged`."""
        model = copy.deepcopy(self.model)
        thresholds, decisions = model.tree_.threshold, model.tree_.value[:, 0]  # views: writing changes the tree
        arrays = [Array(thresholds[self.inner], mirror=1.0), Array(decisions[self.leaves])]
        thresholds[self.inner], decisions[self.leaves] = damage(arrays)
        return DamagedTree(model, self.classes)


@dataclass(frozen=True)
class DamagedTree:
    """A tree whose arrays were changed in place."""

    model: Any
    classes: Floats

    def __call__(self, sensors: Floats) -> Floats:
        """Commands `[B, 2]` for readings `[B, 3]`."""
        return self.classes[self.model.predict(positions(sensors))]


def positions(sensors: Floats) -> Floats:
    """Readings as positions in their sensors' ranges, from 0 to 1."""
    low, high = np.array([(channel.low, channel.high) for channel in sim.SENSORS]).T
    return (sensors - low) / (high - low)
