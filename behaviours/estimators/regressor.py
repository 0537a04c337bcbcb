"""A scikit-learn regressor that is one hypervector."""

import sys
from numbers import Real
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import torch
from jaxtyping import Float64
from sklearn.base import RegressorMixin
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import check_is_fitted
from torch import Tensor

from behaviours.estimators.base import QuantileEncoding
from behaviours.estimators.files import load_fitted, save_fitted
from behaviours.learning.ridge import check_ridge, chosen_ridge, solve
from behaviours.options import as_bool
from behaviours.progress import subrange
from behaviours.schema import Actuator
from behaviours.space import Space


class BehaviourRegressor(RegressorMixin, QuantileEncoding):
    """Predict continuous values for rows of readings `[N, n]` with one hypervector of `dim` numbers.

    Readings are encoded as in `BehaviourClassifier`. Each output is an actuator with a random role, and the value v is
    the hypervector v · role, so that the codes of values interpolate linearly. The program is the solution of a ridge
    regression (`behaviours.learning.ridge.solve`), and an output is the inner product of the unbound result
    with its role. Targets are standardised first.

    `ridge` is the weight of the squared length of the program, in units of that of one stored pair. None takes the one
    of 1, 0.1, ..., 1e-4 with the smallest error on a fifth of the rows, held out at random; `ridge_` is it. The other
    parameters are those of `BehaviourClassifier`, and so is the meaning of `sample_weight`. If `fit` fails, the
    estimator is not changed.

    Fitted attributes: `program_` `[dim]`, `ridge_`, `oblique_`, `space_`, `mean_` and `scale_` `[m]`, `n_features_in_`.
    """

    _parameter_constraints: ClassVar[dict[str, Any]] = {
        **QuantileEncoding._parameter_constraints,
        "ridge": [Interval(Real, 0, None, closed="neither"), None],
    }

    def __init__(
        self,
        dim: int = 4000,
        *,
        bins: int = 4096,
        subset: int = 2,
        oblique: float | None = None,
        ridge: float | None = None,
        random_state: Any = None,
        verbose: int = 0,
    ) -> None:
        self.dim = dim
        self.bins = bins
        self.subset = subset
        self.oblique = oblique
        self.ridge = ridge
        self.random_state = random_state
        self.verbose = verbose

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    def fit(self, X: Any, y: Any, sample_weight: Any = None) -> Self:
        """Train the program on rows `X` `[N, n]` and values `y` `[N]` or `[N, m]`, which count as `sample_weight` says.

        Raises `ValueError` for infinite values, rows of NaN only, features whose range is no finite float, weights
        `[N]` that are negative or all 0, and invalid parameters.
        """
        with self._all_or_nothing():
            self.check_parameters()
            readings, y = self._checked(X, y, multi_output=True, y_numeric=True)
            values = np.asarray(y, dtype=np.float64)
            self._flat = values.ndim == 1
            rows = self._rows(readings, values, sample_weight)
            targets, self.mean_, self.scale_ = _standardised(rows.targets, rows.weights)
            actuators = [Actuator(f"y{i}", -1, 1, levels=2) for i in range(targets.shape[1])]
            self.space_ = self._space(rows, actuators, lambda chosen: torch.from_numpy(targets)[chosen])
            progress = self._progress()
            conditions = torch.cat(self._conditions(self.space_, rows.readings, subrange(progress, 0, 0.5)))
            roles = self.space_.result_encoder.roles
            weights = torch.from_numpy(rows.weights)
            pairs = conditions, roles, torch.from_numpy(targets)
            generator = torch.Generator().manual_seed(self.space_.seed)
            vsa, given = self.space_.vsa, self.ridge
            self.ridge_ = chosen_ridge(vsa, *pairs, weights, generator) if given is None else given
            self.program_ = solve(self.space_.vsa, *pairs, self.ridge_, weights)
            progress(1.0)
        return self

    def check_parameters(self) -> None:
        """See `QuantileEncoding.check_parameters`."""
        super().check_parameters()
        if self.ridge is not None:
            check_ridge(self.ridge)

    def predict(self, X: Any) -> Float64[np.ndarray, "N ..."]:
        """The predicted values, `[N]` or `[N, m]` as in `fit`."""
        check_is_fitted(self)
        readings = self._checked(X, reset=False)
        readout = self.space_.vsa.readout(self.program_.double(), self.space_.result_encoder.roles)
        scores = torch.cat([readout(block) for block in self._conditions(self.space_, readings)])
        # Scores are divided by the lengths of the roles; the inner products are needed here.
        products = scores * readout.lengths
        with np.errstate(over="ignore"):
            values = products.numpy() * self.scale_ + self.mean_
        # Extrapolation from the largest floats may overflow.
        values = values.clip(-sys.float_info.max, sys.float_info.max)
        return values[:, 0] if self._flat else values

    def save(self, path: str | Path) -> Path:
        """Write parameters, codebooks and program to one safetensors file, completely or not at all; no pickles.

        Raises `ValueError` if `random_state` is a generator, and `NotFittedError` before `fit`.
        """
        check_is_fitted(self)
        tensors = {"program": self.program_, "mean": torch.tensor(self.mean_), "scale": torch.tensor(self.scale_)}
        return save_fitted(path, self, self.space_, tensors, {"flat": self._flat})

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a file that `save` wrote. Raises `ValueError` that names the file and what in it is wrong."""

        def restore(model: Self, space: Space, tensors: dict[str, Tensor], about: dict[str, Any]) -> None:
            outputs = len(space.schema.actuators)
            for name, kind, shape in (
                ("program", (torch.float32, torch.float64), (space.vsa.dim,)),
                ("mean", (torch.float64,), (outputs,)),
                ("scale", (torch.float64,), (outputs,)),
            ):
                tensor = tensors[name]
                if tensor.dtype not in kind or tensor.shape != shape or not tensor.isfinite().all():
                    raise ValueError(f"tensor {name!r} must be finite floats {list(shape)}; got {list(tensor.shape)}")
            model.space_, model.program_ = space, tensors["program"]
            model.mean_, model.scale_ = tensors["mean"].numpy(), tensors["scale"].numpy()
            model._flat = as_bool("flat", about["flat"])

        return load_fitted(path, cls, ("program", "mean", "scale"), restore)


_SQUARABLE = 400
"""Values between 2^-400 and 2^400 can be squared and summed in float64."""


def _standardised(
    values: Float64[np.ndarray, "N m"], weights: Float64[np.ndarray, "N"]
) -> tuple[Float64[np.ndarray, "N m"], Float64[np.ndarray, "m"], Float64[np.ndarray, "m"]]:
    """The standardised values, the mean, and the standard deviation (1 where it is 0)."""
    exponent = np.frexp(np.abs(values).max(0))[1]
    # Values outside that range are scaled to about 1 by powers of two, which are exact.
    exponent = np.where(np.abs(exponent) > _SQUARABLE, exponent, 0)
    moderate = np.ldexp(values, -exponent)
    shares = weights / weights.max()
    mean = np.average(moderate, axis=0, weights=shares)
    deviation = np.sqrt(np.average((moderate - mean) ** 2, axis=0, weights=shares))
    unit = np.where(deviation > 0, deviation, 1.0)
    with np.errstate(over="ignore", under="ignore"):
        scale = np.where(deviation > 0, np.ldexp(unit, exponent), 1.0).clip(max=sys.float_info.max)
        return (moderate - mean) / unit, np.ldexp(mean, exponent), scale
