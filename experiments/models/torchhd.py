"""torch-hd's classifiers with scikit-learn's two verbs, so that they stand in a table beside others."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import warnings
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, ClassifierMixin

NAMES = ("Vanilla", "AdaptHD", "OnlineHD", "LeHDC")
MISSING = "torch-hd is not installed, so its classifiers are left out; pip install torch-hd brings them in"
BATCH = 64
"""Rows a step: the batches of 12 of torch-hd's own example take as long and did no better (AdaptHD on the first
stratified fold of 24 sensors, 10 epochs: .951 with 64, .946 with 12)."""


def installed() -> bool:
    """Whether torch-hd can be imported; nothing but this module's `TorchHD` needs it."""
    return importlib.util.find_spec("torchhd") is not None


class TorchHD(ClassifierMixin, BaseEstimator):
    """One of `NAMES` at `dim` dimensions. `epochs` is for those that learn in epochs, None for torch-hd's default.

    Everything else is left as torch-hd has it: 100 levels between -1 and 1, which wants features in units of their
    standard deviation, as in torch-hd's `examples/classifiers.py`.
    """

    def __init__(self, name: str, dim: int, epochs: int | None = None, seed: int = 0) -> None:
        if name not in NAMES:
            raise ValueError(f"there is no classifier {name!r} of torch-hd here; choose from {', '.join(NAMES)}")
        self.name, self.dim, self.epochs, self.seed = name, dim, epochs, seed
        # Loaded here, so that whoever times `fit` does not time this.
        self._make = getattr(importlib.import_module("torchhd.classifiers"), name)

    def fit(self, X: Any, y: Any) -> TorchHD:  # noqa: N803 (scikit-learn's own name)
        """Learn rows `X` `[N, n]` with labels `y` `[N]`."""
        self.classes_, labels = np.unique(y, return_inverse=True)
        rows = torch.utils.data.TensorDataset(torch.tensor(X, dtype=torch.float32), torch.tensor(labels))
        options = {} if self.epochs is None or self.name == "Vanilla" else {"epochs": self.epochs}
        # torch-hd draws from the global generator, shows progress bars of its own, and warns of the class vectors
        # that are zero before its first step.
        with (
            torch.random.fork_rng(devices=[]),
            contextlib.redirect_stderr(io.StringIO()),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore", UserWarning)
            torch.manual_seed(self.seed)
            self.model = self._make(np.shape(X)[1], self.dim, len(self.classes_), **options)
            self.model.fit(torch.utils.data.DataLoader(rows, BATCH, shuffle=True))
        return self

    @torch.no_grad()
    def predict(self, X: Any) -> NDArray[Any]:  # noqa: N803
        """The label of each row, `[N]`."""
        self.model.eval()
        parts = [self.model.predict(block) for block in torch.tensor(X, dtype=torch.float32).split(256)]
        return self.classes_[torch.cat(parts).numpy()]
