"""Fitting models with scikit-learn's two verbs."""

from __future__ import annotations

import time
import warnings
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline


def scaled(model: Any) -> Pipeline:
    """The model with features in units of their standard deviations in the training rows.

    For models that compare or weigh features.
    """
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return make_pipeline(StandardScaler(), model)


def fit_seconds(model: Any, x: NDArray[Any], y: NDArray[Any]) -> float:
    """Fit a model, and return how long it took.

    A model that stops before it has converged is evaluated as it is, without a warning.
    """
    from sklearn.exceptions import ConvergenceWarning

    began = time.perf_counter()
    with warnings.catch_warnings(action="ignore", category=ConvergenceWarning):
        model.fit(x, y)
    return time.perf_counter() - began
