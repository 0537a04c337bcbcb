"""Wall following as a task: what a real robot sensed and commanded, its folds, and a teacher without steps.

The data are the UCI set "Wall-Following Robot Navigation" (see `behaviours.data.load_wall_following`): 24, 4 or 2
distances in metres, and one of four commands for each row.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import StratifiedKFold

from behaviours.data import load_wall_following

Fold = tuple[NDArray[np.int64], NDArray[np.int64]]
"""The rows to train on, and those to test on."""

SENSORS = (24, 4, 2)
FOLDS = 5

samples = cache(load_wall_following)
"""Readings `[N, n]` and commands `[N]` for a number of sensors. Reading the file takes as long as some fits."""


def stratified(labels: NDArray[Any]) -> list[Fold]:
    """Five random folds, shuffled with seed 0; each class is spread evenly over them."""
    return list(StratifiedKFold(FOLDS, shuffle=True, random_state=0).split(labels, labels))


def blocks(labels: NDArray[Any]) -> list[Fold]:
    """Five folds that are contiguous in time; the first are longer by a row if the rows do not divide evenly."""
    rows = np.arange(len(labels))
    return [(np.setdiff1d(rows, test), test) for test in np.array_split(rows, FOLDS)]


SPLITS: dict[str, Callable[[NDArray[Any]], list[Fold]]] = {"stratified": stratified, "blocks": blocks}


def wall_commands(front: NDArray[np.float64], left: NDArray[np.float64]) -> NDArray[np.float64]:
    """Follow the wall on the left at about 0.7 m: commands `[N, 2]` in [-1, 1] for two distances `[N]`, m.

    Drive unless something is near in front, steer by the distance of the wall, and turn right where the way is blocked.
    """
    drive = 1 / (1 + np.exp(-(front - 0.9) / 0.15))
    turn = drive * np.tanh((left - 0.7) / 0.3) - (1 - drive)
    return np.clip(np.stack([drive - turn / 2, drive + turn / 2], axis=1), -1, 1)
