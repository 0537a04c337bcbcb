"""The learners without hypervectors, an MLP and a decision tree, whose parameters are damaged."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier
from sklearn.tree import DecisionTreeClassifier

import sim
from behaviours import Demonstrations
from experiments.damage import Array, Damage, Damaged, Floats, Learner


class Network(Learner):
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

    def damaged(self, part: str, damage: Damage) -> Damaged:
        """See `Learner.damaged`."""
        values = damage([Array(layer.ravel()) for layer in self.layers])
        layers = [value.reshape(layer.shape) for value, layer in zip(values, self.layers, strict=True)]
        return _NetworkPolicy(self.mean, self.scale, layers, self.classes)


@dataclass(frozen=True)
class _NetworkPolicy:
    mean: Floats
    scale: Floats
    layers: list[Floats]
    classes: Floats

    def __call__(self, sensors: Floats) -> Floats:
        weights_in, weights_out, bias_in, bias_out = self.layers
        hidden = np.maximum((sensors - self.mean) / self.scale @ weights_in + bias_in, 0.0)
        return self.classes[(hidden @ weights_out + bias_out).argmax(-1)]


class Tree(Learner):
    """A decision tree; its parameters are the thresholds and the decisions of its leaves.

    A threshold is a place in its sensor's range, from 0 to 1: flipped it is mirrored within the range, zero is the low
    end. A leaf's decision is one element, the scores of its commands (the shares of its samples): flipped they are
    negated, so that another command wins; without any score the first command does.
    """

    def __init__(self, train: Demonstrations, seed: int) -> None:
        self.classes, labels = np.unique(train.commands.numpy(), axis=0, return_inverse=True)
        self.low, high = np.array([(sensor.low, sensor.high) for sensor in sim.SENSORS]).T
        self.span = high - self.low
        places = (train.sensors.numpy() - self.low) / self.span
        self.model = DecisionTreeClassifier(random_state=seed).fit(places, labels.ravel())
        self.tree: Any = self.model.tree_
        self.inner = np.flatnonzero(self.tree.children_left >= 0)
        self.leaves = np.flatnonzero(self.tree.children_left < 0)

    def elements(self, part: str) -> int:
        """See `Learner.elements`."""
        return len(self.inner) + len(self.leaves)

    def damaged(self, part: str, damage: Damage) -> Damaged:
        """See `Learner.damaged`."""
        thresholds = np.array(self.tree.threshold, dtype=np.float64)
        decisions = np.array(self.tree.value[:, 0], dtype=np.float64)
        arrays = [Array(thresholds[self.inner], mirror=1.0), Array(decisions[self.leaves])]
        thresholds[self.inner], decisions[self.leaves] = damage(arrays)
        children = np.stack([self.tree.children_left, self.tree.children_right])
        answers = self.classes[decisions.argmax(-1)]
        return _TreePolicy(self.low, self.span, np.array(self.tree.feature), children, thresholds, answers)


@dataclass(frozen=True)
class _TreePolicy:
    low: Floats
    span: Floats
    feature: NDArray[np.int64]
    children: NDArray[np.int64]
    thresholds: Floats
    answers: Floats

    def __call__(self, sensors: Floats) -> Floats:
        # The tree compares in single precision, and its thresholds lie between readings of that precision.
        places = ((sensors - self.low) / self.span).astype(np.float32)
        node = np.zeros(len(places), dtype=np.int64)
        rows = np.arange(len(places))
        while (inner := self.children[0, node] >= 0).any():
            right = places[rows, self.feature[node]] > self.thresholds[node]
            node = np.where(inner, self.children[right.astype(np.int64), node], node)
        return self.answers[node]
