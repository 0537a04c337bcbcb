"""Scikit-learn estimators: a classifier and a regressor, each of which is one hypervector.

This module and `behaviours.quantiles`, its base, need scikit-learn; `behaviours` imports them on first access.
"""

import sys
from typing import Any, Self

import numpy as np
import torch
from jaxtyping import Float64, Int64, Shaped
from sklearn.base import ClassifierMixin, RegressorMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted
from torch import Tensor

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning import Gradient, no_convergence_warnings
from behaviours.learning.least_squares import check_ridge, solve
from behaviours.progress import subrange
from behaviours.quantiles import QuantileEncoding
from behaviours.report import LearningReport
from behaviours.schema import Actuator
from behaviours.space import Space


class BehaviourClassifier(ClassifierMixin, QuantileEncoding):
    """Classify rows of readings `[N, n]` with one hypervector of `dim` numbers.

    Each feature is a sensor, binned at the quantiles of its training values. Each dimension of a condition compares a
    few random sensors (at most `subset`) with random thresholds, and binds the outcomes. The classes are random
    hypervectors. Only the program is trained, by `Gradient(sparse=True)`: class j scores
    `<condition ⊗ program, class_j>`. NaN means not observed, and is left out; values outside the range of the training
    rows are clipped to it.

    | parameter | meaning |
    |---|---|
    | `dim` | elements of the program |
    | `bins` | the most quantile bins per feature; their edges take features · bins floats |
    | `subset` | the most features that interact in one dimension |
    | `epochs`, `batch_size`, `learning_rate` | of the gradient descent |
    | `random_state` | the seed of codebooks and batches |
    | `verbose` | 1 prints the progress of the training |

    The codebook takes about 17 · `subset` · `dim` bytes, for any number of bins and features. If `fit` or `partial_fit`
    fails, the estimator is not changed.

    Fitted attributes: `classes_` `[K]`, `behaviour_` (a `Behaviour`, whose `program` is the hypervector),
    `n_features_in_`.
    """

    def __init__(
        self,
        dim: int = 4000,
        *,
        bins: int = 4096,
        subset: int = 2,
        epochs: int = 100,
        batch_size: int = 128,
        learning_rate: float = 0.05,
        random_state: Any = None,
        verbose: int = 0,
    ) -> None:
        self.dim = dim
        self.bins = bins
        self.subset = subset
        self.epochs = epochs
        self.batch_size = batch_size
        self.learning_rate = learning_rate
        self.random_state = random_state
        self.verbose = verbose

    @no_convergence_warnings()
    def fit(self, X: Any, y: Any) -> Self:  # noqa: N803 (scikit-learn's own name)
        """Train the program on rows `X` `[N, n]` and labels `y` `[N]`.

        Raises `ValueError` for fewer than two classes, infinite values, rows of NaN only, features whose range is no
        finite float, and invalid parameters.
        """
        with self._all_or_nothing():
            self._check_parameters()
            readings, y = self._checked(X, y)
            check_classification_targets(y)
            self.classes_, labels = np.unique(y, return_inverse=True)
            if len(self.classes_) < 2:
                raise ValueError(
                    f"a classifier needs at least 2 classes; the data hold one class, {self.classes_[0]!r}"
                )
            space = self._class_space(readings)
            shown = Demonstrations(torch.tensor(readings), torch.tensor(labels[:, None]))
            self.behaviour_ = self._rule(space.seed).fit(space, shown, self._progress())
        return self

    @no_convergence_warnings()
    def partial_fit(self, X: Any, y: Any, classes: Any = None) -> Self:  # noqa: N803
        """Continue training with rows `X` `[N, n]` and labels `y` `[N]`; the first call needs all `classes`.

        The bin edges come from the first call, whose readings should span those of later calls, since values outside
        their range are clipped to it. Each call trains for `epochs` on its rows alone, which may make the program
        forget earlier rows: take few epochs if each call shows one class.

        Raises `ValueError` for labels that are not in `classes`, and where `fit` does.
        """
        with self._all_or_nothing():
            self._check_parameters()
            first = not hasattr(self, "behaviour_")
            readings, y = self._checked(X, y, reset=first)
            check_classification_targets(y)
            unique = None if classes is None else np.unique(classes)
            if first:
                if unique is None or len(unique) < 2:
                    raise ValueError(
                        f"the first call of partial_fit needs all classes, at least 2; got classes={classes}"
                    )
                self.classes_ = unique
            elif unique is not None and not np.array_equal(unique, self.classes_):
                raise ValueError(f"classes are {self.classes_} since the first call; got {unique}")
            if len(unknown := np.setdiff1d(y, self.classes_)):
                raise ValueError(f"y holds {unknown[0]!r}, which is none of the classes {self.classes_}")
            before = self._untrained(self._class_space(readings)) if first else self.behaviour_
            labels = torch.from_numpy(np.searchsorted(self.classes_, y)[:, None])
            # Each call has another seed, so that it visits its rows in another order.
            rule = self._rule(before.space.seed + before.report.updates)
            shown = Demonstrations(torch.tensor(readings), labels)
            self.behaviour_ = rule.partial_fit(before, shown, self._progress())
        return self

    def _check_parameters(self) -> None:
        super()._check_parameters()
        self._rule(seed=0)

    def _class_space(self, readings: Float64[np.ndarray, "N n"]) -> Space:
        count = len(self.classes_)
        return self._space(readings, [Actuator("class", 0, count - 1, levels=count)])

    def _rule(self, seed: int) -> Gradient:
        return Gradient(
            epochs=self.epochs, batch_size=self.batch_size, learning_rate=self.learning_rate, sparse=True, seed=seed
        )

    def _untrained(self, space: Space) -> Behaviour:
        """A behaviour that has all classes as results, and no known conditions."""
        zeros = torch.zeros(space.vsa.dim)
        known = zeros.to(space.vsa.accumulator)
        levels = torch.arange(len(self.classes_))[:, None]
        return Behaviour(space, zeros, known, levels, LearningReport(Gradient.name, samples=0, new=0, epochs=0))

    def _scores(self, X: Any) -> Float64[np.ndarray, "N K"]:  # noqa: N803
        check_is_fitted(self)
        readings = self._checked(X, reset=False)
        behaviour = self.behaviour_
        # In float64 the scores of a row do not visibly depend on the other rows of the batch.
        readout = behaviour.readout().of(behaviour.program.double())
        rows = [readout(block) for block in self._conditions(behaviour.space, readings)]
        # The clean-up memory is in order of first appearance, the columns in order of the classes.
        columns: Int64[Tensor, "K"] = behaviour.results[:, 0].argsort()
        return torch.cat(rows)[:, columns].numpy()

    def decision_function(self, X: Any) -> Float64[np.ndarray, "N ..."]:  # noqa: N803
        """The score of each class, `[N, K]`; for two classes, the score of the second less that of the first, `[N]`."""
        scores = self._scores(X)
        return scores[:, 1] - scores[:, 0] if len(self.classes_) == 2 else scores

    def predict_proba(self, X: Any) -> Float64[np.ndarray, "N K"]:  # noqa: N803
        """The softmax of the scores, `[N, K]`, which the loss of the training uses."""
        return torch.softmax(torch.from_numpy(self._scores(X)), 1).numpy()

    def predict(self, X: Any) -> Shaped[np.ndarray, "N"]:  # noqa: N803
        """The class with the highest score, `[N]`."""
        best = self._scores(X).argmax(1)
        return self.classes_[best]


class BehaviourRegressor(RegressorMixin, QuantileEncoding):
    """Predict continuous values for rows of readings `[N, n]` with one hypervector of `dim` numbers.

    Readings are encoded as in `BehaviourClassifier`. Each output is an actuator with a random role, and the value v is
    the hypervector v · role, so that the codes of values interpolate linearly. The program is the solution of a ridge
    regression (`behaviours.learning.least_squares.solve`), and an output is the inner product of the unbound result
    with its role. Targets are standardised first.

    `ridge` is the weight of the squared length of the program, in units of that of one stored pair; the other
    parameters are those of `BehaviourClassifier`. If `fit` fails, the estimator is not changed.

    Fitted attributes: `program_` `[dim]`, `space_`, `mean_` and `scale_` `[m]`, `n_features_in_`.
    """

    def __init__(
        self,
        dim: int = 4000,
        *,
        bins: int = 4096,
        subset: int = 2,
        ridge: float = 0.1,
        random_state: Any = None,
        verbose: int = 0,
    ) -> None:
        self.dim = dim
        self.bins = bins
        self.subset = subset
        self.ridge = ridge
        self.random_state = random_state
        self.verbose = verbose

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    def fit(self, X: Any, y: Any) -> Self:  # noqa: N803
        """Train the program on rows `X` `[N, n]` and values `y` `[N]` or `[N, m]`.

        Raises `ValueError` for infinite values, rows of NaN only, features whose range is no finite float, and invalid
        parameters.
        """
        with self._all_or_nothing():
            self._check_parameters()
            readings, y = self._checked(X, y, multi_output=True, y_numeric=True)
            values = np.asarray(y, dtype=np.float64)
            self._flat = values.ndim == 1
            targets, self.mean_, self.scale_ = _standardised(values.reshape(len(values), -1))
            actuators = [Actuator(f"y{i}", -1, 1, levels=2) for i in range(targets.shape[1])]
            self.space_ = self._space(readings, actuators)
            progress = self._progress()
            conditions = torch.cat(self._conditions(self.space_, readings, subrange(progress, 0, 0.5)))
            roles = self.space_.result_encoder.roles
            self.program_ = solve(self.space_.vsa, conditions, roles, torch.from_numpy(targets), self.ridge)
            progress(1.0)
        return self

    def _check_parameters(self) -> None:
        super()._check_parameters()
        check_ridge(self.ridge)

    def predict(self, X: Any) -> Float64[np.ndarray, "N ..."]:  # noqa: N803
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


_SQUARABLE = 400
"""Values between 2^-400 and 2^400 can be squared and summed in float64."""


def _standardised(
    values: Float64[np.ndarray, "N m"],
) -> tuple[Float64[np.ndarray, "N m"], Float64[np.ndarray, "m"], Float64[np.ndarray, "m"]]:
    """The standardised values, the mean, and the standard deviation (1 where it is 0)."""
    exponent = np.frexp(np.abs(values).max(0))[1]
    # Values outside that range are scaled to about 1 by powers of two, which are exact.
    exponent = np.where(np.abs(exponent) > _SQUARABLE, exponent, 0)
    moderate = np.ldexp(values, -exponent)
    mean, deviation = moderate.mean(0), moderate.std(0)
    unit = np.where(deviation > 0, deviation, 1.0)
    with np.errstate(over="ignore", under="ignore"):
        scale = np.where(deviation > 0, np.ldexp(unit, exponent), 1.0).clip(max=sys.float_info.max)
        return (moderate - mean) / unit, np.ldexp(mean, exponent), scale
