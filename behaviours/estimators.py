"""Estimators for scikit-learn: one hypervector that classifies, and one that interpolates.

With their base, `behaviours.quantiles`, the only modules of the behaviours that need scikit-learn; `behaviours` loads
them when they are asked for.
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
from behaviours.learning.least_squares import solve
from behaviours.progress import subrange
from behaviours.quantiles import QuantileEncoding
from behaviours.report import LearningReport
from behaviours.schema import Actuator
from behaviours.space import Space


class BehaviourClassifier(ClassifierMixin, QuantileEncoding):
    """Classify rows of readings `[N, n]` with one hypervector of `dim` numbers.

    Each feature is a sensor, binned at the quantiles of its training values; each dimension of a condition
    asks whether a random few of the sensors (at most `subset`) lie above thresholds of their own, and binds the
    answers. The classes are random hypervectors. The program alone is trained on the labels, by
    `Gradient(sparse=True)`: class j scores `<condition ⊗ program, class_j>`. NaN is not observed, and left out;
    values beyond those of the training rows count as the nearest of them.

    | parameter | meaning |
    |---|---|
    | `dim` | elements of the program |
    | `bins` | quantile bins per feature, at most; their edges take features · bins floats |
    | `subset` | most features that interact in one dimension |
    | `epochs`, `batch_size`, `learning_rate` | of the gradient descent |
    | `random_state` | seeds codebooks and batches |
    | `verbose` | 1 prints now and then which share of the training is done |

    The codebook takes about 17 · `subset` · `dim` bytes, however many bins and features there are. A `fit` or
    `partial_fit` that fails leaves the estimator as it was.

    Fitted: `classes_` `[K]`, `behaviour_` (a `Behaviour`; its `program` is the hypervector), `n_features_in_`.
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

        Raises `ValueError` for fewer than two classes, infinite values, rows without any value, features whose range is
        no finite float, and parameters that cannot work.
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
        """Go on training with rows `X` `[N, n]` and labels `y` `[N]`; the first call needs all `classes`.

        The edges of the bins come from the first batch: it should span the readings to come, since
        values beyond it count as the nearest of them. Each call goes `epochs` times through its own rows, and nothing
        else reminds the program of earlier ones: with batches of one class each, take few epochs.

        Raises `ValueError` for labels that are none of `classes`, and as `fit` does.
        """
        with self._all_or_nothing():
            self._check_parameters()
            first = not hasattr(self, "behaviour_")
            readings, y = self._checked(X, y, reset=first)
            check_classification_targets(y)
            given = None if classes is None else np.unique(classes)
            if first:
                if given is None or len(given) < 2:
                    raise ValueError(
                        f"the first call of partial_fit needs all classes, at least 2; got classes={classes}"
                    )
                self.classes_ = given
            elif given is not None and not np.array_equal(given, self.classes_):
                raise ValueError(f"classes are {self.classes_} since the first call; got {given}")
            if len(unknown := np.setdiff1d(y, self.classes_)):
                raise ValueError(f"y holds {unknown[0]!r}, which is none of the classes {self.classes_}")
            before = self._blank(self._class_space(readings)) if first else self.behaviour_
            labels = torch.from_numpy(np.searchsorted(self.classes_, y)[:, None])
            # Another seed for each call, or all would visit their rows in the same order.
            rule = self._rule(before.space.seed + before.report.updates)
            shown = Demonstrations(torch.tensor(readings), labels)
            self.behaviour_ = rule.partial_fit(before, shown, self._progress())
        return self

    def _check_parameters(self) -> None:
        super()._check_parameters()
        self._whole("epochs")
        self._whole("batch_size")
        if self._positive("learning_rate") > 1e30:
            # The program is float32, and so are its steps.
            raise ValueError(f"learning_rate must be a number of float32, at most 1e30; got {self.learning_rate!r}")

    def _class_space(self, readings: Float64[np.ndarray, "N n"]) -> Space:
        count = len(self.classes_)
        return self._space(readings, [Actuator("class", 0, count - 1, levels=count)])

    def _rule(self, seed: int) -> Gradient:
        epochs, batch_size, rate = self._whole("epochs"), self._whole("batch_size"), self._positive("learning_rate")
        return Gradient(epochs=epochs, batch_size=batch_size, learning_rate=rate, sparse=True, seed=seed)

    def _blank(self, space: Space) -> Behaviour:
        """The behaviour that knows all classes and no condition."""
        zeros = torch.zeros(space.vsa.dim)
        known = zeros.to(space.vsa.accumulator)
        levels = torch.arange(len(self.classes_))[:, None]
        return Behaviour(space, zeros, known, levels, LearningReport(Gradient.name, samples=0, new=0, epochs=0))

    def _scores(self, X: Any) -> Float64[np.ndarray, "N K"]:  # noqa: N803
        check_is_fitted(self)
        readings = self._checked(X, reset=False)
        behaviour = self.behaviour_
        # In float64 a row scores the same, to all digits shown, whatever other rows it stands among.
        readout = behaviour.readout().of(behaviour.program.double())
        rows = [readout(block) for block in self._conditions(behaviour.space, readings)]
        # The clean-up memory is in order of first insertion, the columns in that of the classes.
        columns: Int64[Tensor, "K"] = behaviour.results[:, 0].argsort()
        return torch.cat(rows)[:, columns].numpy()

    def decision_function(self, X: Any) -> Float64[np.ndarray, "N ..."]:  # noqa: N803
        """The score of each class, `[N, K]`; for two classes the second's lead over the first, `[N]`."""
        answers = self._scores(X)
        return answers[:, 1] - answers[:, 0] if len(self.classes_) == 2 else answers

    def predict_proba(self, X: Any) -> Float64[np.ndarray, "N K"]:  # noqa: N803
        """The softmax of the scores, by which the program was trained, `[N, K]`."""
        return torch.softmax(torch.from_numpy(self._scores(X)), 1).numpy()

    def predict(self, X: Any) -> Shaped[np.ndarray, "N"]:  # noqa: N803
        """The class whose hypervector the answer resembles most, `[N]`."""
        best = self._scores(X).argmax(1)
        return self.classes_[best]


class BehaviourRegressor(RegressorMixin, QuantileEncoding):
    """Answer rows of readings `[N, n]` with smooth values, by one hypervector of `dim` numbers.

    Readings are encoded as in `BehaviourClassifier`. Each output is an actuator with a random role, and the
    value v is the hypervector v · role, so that values between those shown lie between their codes. The program
    solves a ridge problem (`behaviours.learning.least_squares.solve`), and an output is the answer's product with its
    role. Deviations from the mean of the training rows are learned, in units of their standard deviation.

    `ridge` is the weight of the program's squared length, in units of one stored pair's; the other parameters as
    there. A `fit` that fails leaves the estimator as it was.

    Fitted: `program_` `[dim]`, `space_`, `mean_` and `scale_` `[m]`, `n_features_in_`.
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

        Raises `ValueError` for infinite values, rows without any value, features whose range is no finite float, and
        parameters that cannot work.
        """
        with self._all_or_nothing():
            self._check_parameters()
            ridge = self._positive("ridge")
            readings, y = self._checked(X, y, multi_output=True, y_numeric=True)
            values = np.asarray(y, dtype=np.float64)
            self._flat = values.ndim == 1
            targets, self.mean_, self.scale_ = _standardised(values.reshape(len(values), -1))
            actuators = [Actuator(f"y{i}", -1, 1, levels=2) for i in range(targets.shape[1])]
            self.space_ = self._space(readings, actuators)
            progress = self._progress()
            conditions = torch.cat(self._conditions(self.space_, readings, subrange(progress, 0, 0.5)))
            self.program_ = self._solved(conditions, torch.from_numpy(targets), ridge)
            progress(1.0)
        return self

    def _solved(
        self, conditions: Shaped[Tensor, "N d"], targets: Float64[Tensor, "N m"], ridge: float
    ) -> Shaped[Tensor, "d"]:
        """The program of the ridge problem; raises `ValueError` where `ridge` leaves it without a solution."""
        try:
            program = solve(self.space_.vsa, conditions, self.space_.result_encoder.roles, targets, ridge)
        except torch.linalg.LinAlgError as error:  # pyright: ignore[reportPrivateImportUsage]
            raise ValueError(f"ridge={ridge} leaves the system of these rows singular; take a larger one") from error
        if not program.isfinite().all():
            raise ValueError(f"ridge={ridge} leaves no finite solution for these rows; take one nearer to 1")
        return program

    def predict(self, X: Any) -> Float64[np.ndarray, "N ..."]:  # noqa: N803
        """The values that the program answers, `[N]` or `[N, m]` as in `fit`."""
        check_is_fitted(self)
        readings = self._checked(X, reset=False)
        readout = self.space_.vsa.readout(self.program_.double(), self.space_.result_encoder.roles)
        scores = torch.cat([readout(block) for block in self._conditions(self.space_, readings)])
        # A product with a role, not with a role of length 1.
        answers = scores * readout.lengths
        with np.errstate(over="ignore"):
            values = answers.numpy() * self.scale_ + self.mean_
        # Answers a little beyond the values shown may be beyond the largest float.
        values = values.clip(-sys.float_info.max, sys.float_info.max)
        return values[:, 0] if self._flat else values


_SQUARABLE = 400
"""Values between 2^-400 and 2^400 can be squared and summed in float64."""


def _standardised(
    values: Float64[np.ndarray, "N m"],
) -> tuple[Float64[np.ndarray, "N m"], Float64[np.ndarray, "m"], Float64[np.ndarray, "m"]]:
    """Deviations from the mean in units of the standard deviation (1 where there is none), the mean, and the unit."""
    exponent = np.frexp(np.abs(values).max(0))[1]
    # Powers of two, which change no digit, bring the others to about 1.
    exponent = np.where(np.abs(exponent) > _SQUARABLE, exponent, 0)
    moderate = np.ldexp(values, -exponent)
    mean, deviation = moderate.mean(0), moderate.std(0)
    unit = np.where(deviation > 0, deviation, 1.0)
    with np.errstate(over="ignore", under="ignore"):
        scale = np.where(deviation > 0, np.ldexp(unit, exponent), 1.0).clip(max=sys.float_info.max)
        return (moderate - mean) / unit, np.ldexp(mean, exponent), scale
