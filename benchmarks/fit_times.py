"""How long learning real data takes, and how well it is learned: one hypervector compared with torch-hd's AdaptHD.

Both learn the same stratified folds in turns, in one process. It takes about ten minutes, so a whole run leaves it out.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import torch

from experiments.models.classifiers import CLASSIFIERS, accuracy
from experiments.tasks.wall_following import FOLDS, samples, stratified

OURS, PEER = "one_hypervector", "torchhd_adapthd"
DEFAULT_EPOCHS = 120
"""What torch-hd does if it is not told a number of epochs."""


def fits(sensors: int, dim: int, folds: int, epochs: int | None, threads: int, seed: int = 0) -> list[dict[str, Any]]:
    """One row for each stratified fold and model, with its accuracy and seconds. All threads are theirs."""
    readings, labels = samples(sensors)
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        return [
            {"model": model, "fold": place, **accuracy(CLASSIFIERS[model](dim, epochs, seed), readings, labels, fold)}
            for place, fold in enumerate(stratified(labels)[:folds])
            for model in (OURS, PEER)
        ]
    finally:
        torch.set_num_threads(before)


def rows(threads: int, small: bool = False) -> Iterator[dict[str, Any]]:
    """One row: the seconds of all folds, and the mean accuracies on the rows left out."""
    sensors, dim, folds, epochs = (2, 50, 2, 1) if small else (24, 4000, FOLDS, None)
    found = fits(sensors, dim, folds, epochs, threads)
    seconds = {model: sum(row["fit_s"] for row in found if row["model"] == model) for model in (OURS, PEER)}
    shares = {model: float(np.mean([r["accuracy"] for r in found if r["model"] == model])) for model in (OURS, PEER)}
    yield {
        "work": "fit wall following",
        "shape": f"{sensors} sensors, {folds} folds, d={dim}",
        "threads": threads,
        "ours_s": seconds[OURS],
        "ours_accuracy": shares[OURS],
        "peer": f"torchhd AdaptHD, epochs: {epochs or DEFAULT_EPOCHS}",
        "peer_s": seconds[PEER],
        "peer_accuracy": shares[PEER],
        "ratio": seconds[PEER] / seconds[OURS],
        "device": "cpu",
    }
