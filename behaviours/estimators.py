"""Estimators for scikit-learn: one hypervector that classifies, and one that interpolates.

The only module of the behaviours that needs scikit-learn; `behaviours` loads it when it is asked for.
"""

from typing import Any, Self

import numpy as np
import torch
from jaxtyping import Float64, Int64, Shaped
from sklearn.base import BaseEstimator, ClassifierMixin, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data
from torch import Tensor

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning import Gradient, no_convergence_warnings
from behaviours.learning.least_squares import solve
from behaviours.recall import scores
from behaviours.report import LearningReport
from behaviours.schema import Actuator, Schema, Sensor, quantile_edges
from behaviours.space import Encoder, Space
from torchvsa import MAP
from torchvsa.exact import dots, norms

_ROWS = 1024
"""Rows encoded at once."""


class _Encoding(BaseEstimator):
    """What classifier and regressor share: sensors that are binned at the quantiles of their readings."""

    dim: int
    bins: int
    subset: int
    random_state: Any

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags

    def _space(self, readings: Float64[np.ndarray, "N n"], actuators: list[Actuator], seed: int) -> Space:
        """Codebooks for these readings; the edges of the bins see nothing but the readings."""
        names = getattr(self, "feature_names_in_", [f"x{i}" for i in range(readings.shape[1])])
        sensors = []
        for name, column in zip(names, torch.tensor(readings).T, strict=True):
            seen = column[~column.isnan()]
            low, high = (seen.min().item(), seen.max().item()) if len(seen) else (0.0, 0.0)
            # A constant reading has no range, and a sensor needs one.
            low, high = (low, high) if low < high else (low - 1, high + 1)
            sensors.append(Sensor(str(name), low, high, beyond="clip", edges=quantile_edges(seen, self.bins).tolist()))
        encoder = Encoder(self.bins, combine="thresholds", subset=self.subset, results="balanced")
        vsa = MAP(self.dim, dtype=torch.int8)
        return Space(Schema(sensors, actuators), vsa, encoder, protection="none", seed=seed)

    def _conditions(self, space: Space, readings: Float64[np.ndarray, "N n"]) -> list[Shaped[Tensor, "batch d"]]:
        """The encoded rows, some at a time; raises for rows in which nothing was observed."""
        blind = np.isnan(readings).all(1)
        if blind.any():
            raise ValueError(f"row {int(blind.argmax())} has no observed feature: all of its values are NaN")
        blocks = torch.tensor(readings).split(_ROWS)
        return [space.encode(space.bins(block)) for block in blocks]

    def _checked(self, *data: Any, **options: Any) -> Any:
        """Readings `[N, n]` as float64, and targets where they are given, as scikit-learn checks them."""
        return validate_data(self, *data, dtype=np.float64, order="C", ensure_all_finite="allow-nan", **options)

    def _seed(self) -> int:
        return int(check_random_state(self.random_state).randint(2**31 - 1))


class BehaviourClassifier(ClassifierMixin, _Encoding):
    """Classify rows of readings `[N, n]` with one hypervector of `dim` numbers.

    Each feature is a sensor, binned at the quantiles of its training values; each dimension of a condition
    asks whether a random few of the sensors (at most `subset`) lie above thresholds of their own, and binds the
    answers. The classes are random hypervectors. The program alone is trained on the labels, by
    `Gradient(sparse=True)`: class j scores `<condition ⊗ program, class_j>`. NaN is not observed, and left out;
    values beyond those of the training rows count as the nearest of them.

    | parameter | meaning |
    |---|---|
    | `dim` | elements of the program |
    | `bins` | quantile bins per feature, at most; the codebook takes features · (bins + 1) · dim bytes |
    | `subset` | most features that interact in one dimension |
    | `passes`, `batch`, `learning_rate` | of the gradient descent |
    | `random_state` | seeds codebooks and batches |

    Fitted: `classes_` `[K]`, `behaviour_` (a `Behaviour`; its `program` is the hypervector), `n_features_in_`.
    """

    def __init__(
        self,
        dim: int = 4000,
        *,
        bins: int = 4096,
        subset: int = 2,
        passes: int = 100,
        batch: int = 128,
        learning_rate: float = 0.05,
        random_state: Any = None,
    ) -> None:
        self.dim = dim
        self.bins = bins
        self.subset = subset
        self.passes = passes
        self.batch = batch
        self.learning_rate = learning_rate
        self.random_state = random_state

    @no_convergence_warnings()
    def fit(self, X: Any, y: Any) -> Self:  # noqa: N803 (scikit-learn's own name)
        """Train the program on rows `X` `[N, n]` and labels `y` `[N]`.

        Raises `ValueError` for fewer than two classes, infinite values, and rows without any value.
        """
        readings, y = self._checked(X, y)
        check_classification_targets(y)
        self.classes_, labels = np.unique(y, return_inverse=True)
        if len(self.classes_) < 2:
            raise ValueError(f"a classifier needs at least 2 classes; the data hold one class, {self.classes_[0]!r}")
        space = self._class_space(readings)
        shown = Demonstrations(torch.tensor(readings), torch.tensor(labels[:, None]))
        self.behaviour_ = self._rule(space.seed).fit(space, shown)
        return self

    @no_convergence_warnings()
    def partial_fit(self, X: Any, y: Any, classes: Any = None) -> Self:  # noqa: N803
        """Go on training with rows `X` `[N, n]` and labels `y` `[N]`; the first call needs all `classes`.

        The edges of the bins come from the first batch: it should span the readings to come, since
        values beyond it count as the nearest of them. Each call goes `passes` times through its own rows, and nothing
        else reminds the program of earlier ones: with batches of one class each, take few passes.

        Raises `ValueError` for labels that are none of `classes`, and as `fit` does.
        """
        first = not hasattr(self, "behaviour_")
        readings, y = self._checked(X, y, reset=first)
        check_classification_targets(y)
        given = None if classes is None else np.unique(classes)
        if first:
            if given is None or len(given) < 2:
                raise ValueError(f"the first call of partial_fit needs all classes, at least 2; got classes={classes}")
            self.classes_ = given
        elif given is not None and not np.array_equal(given, self.classes_):
            raise ValueError(f"classes are {self.classes_} since the first call; got {given}")
        if len(unknown := np.setdiff1d(y, self.classes_)):
            raise ValueError(f"y holds {unknown[0]!r}, which is none of the classes {self.classes_}")
        if first:
            self.behaviour_ = self._blank(self._class_space(readings))
        labels = torch.from_numpy(np.searchsorted(self.classes_, y)[:, None])
        before = self.behaviour_
        # Another seed for each call, or all would visit their rows in the same order.
        rule = self._rule(before.space.seed + before.report.updates)
        self.behaviour_ = rule.partial_fit(before, Demonstrations(torch.tensor(readings), labels))
        return self

    def _class_space(self, readings: Float64[np.ndarray, "N n"]) -> Space:
        count = len(self.classes_)
        return self._space(readings, [Actuator("class", 0, count - 1, levels=count)], self._seed())

    def _rule(self, seed: int) -> Gradient:
        return Gradient(passes=self.passes, batch=self.batch, learning_rate=self.learning_rate, sparse=True, seed=seed)

    def _blank(self, space: Space) -> Behaviour:
        """The behaviour that knows all classes and no condition."""
        zeros = torch.zeros(space.vsa.dim)
        known = zeros.to(space.vsa.accumulator)
        levels = torch.arange(len(self.classes_))[:, None]
        return Behaviour(space, zeros, known, levels, LearningReport(Gradient.name, samples=0, new=0, passes=0))

    def _scores(self, X: Any) -> Float64[np.ndarray, "N K"]:  # noqa: N803
        check_is_fitted(self)
        readings = self._checked(X, reset=False)
        behaviour = self.behaviour_
        items = behaviour.memory.items
        # In float64 a row scores the same, to all digits shown, whatever other rows it stands among.
        program, lengths = behaviour.program.double(), norms(items)
        rows = [
            scores(behaviour.space.vsa, program, block, items, lengths)
            for block in self._conditions(behaviour.space, readings)
        ]
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


class BehaviourRegressor(RegressorMixin, _Encoding):
    """Answer rows of readings `[N, n]` with smooth values, by one hypervector of `dim` numbers.

    Readings are encoded as in `BehaviourClassifier`. Each output is an actuator with a random role, and the
    value v is the hypervector v · role, so that values between those shown lie between their codes. The program
    solves a ridge problem (`behaviours.learning.least_squares.solve`), and an output is the answer's product with its
    role. Deviations from the mean of the training rows are learned, in units of their standard deviation.

    `ridge` is the weight of the program's squared length, in units of one stored pair's; the other parameters as
    there. Fitted: `program_` `[dim]`, `space_`, `mean_` and `scale_` `[m]`, `n_features_in_`.
    """

    def __init__(
        self,
        dim: int = 4000,
        *,
        bins: int = 4096,
        subset: int = 2,
        ridge: float = 0.1,
        random_state: Any = None,
    ) -> None:
        self.dim = dim
        self.bins = bins
        self.subset = subset
        self.ridge = ridge
        self.random_state = random_state

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    def fit(self, X: Any, y: Any) -> Self:  # noqa: N803
        """Train the program on rows `X` `[N, n]` and values `y` `[N]` or `[N, m]`.

        Raises `ValueError` for infinite values and rows without any value.
        """
        readings, y = self._checked(X, y, multi_output=True, y_numeric=True)
        values = np.asarray(y, dtype=np.float64)
        self._flat = values.ndim == 1
        values = values.reshape(len(values), -1)
        self.mean_, deviation = values.mean(0), values.std(0)
        self.scale_ = np.where(deviation > 0, deviation, 1.0)
        actuators = [Actuator(f"y{i}", -1, 1, levels=2) for i in range(values.shape[1])]
        self.space_ = self._space(readings, actuators, self._seed())
        conditions = torch.cat(self._conditions(self.space_, readings))
        targets = torch.from_numpy((values - self.mean_) / self.scale_)
        roles = self.space_.results.roles
        self.program_ = solve(self.space_.vsa, conditions, roles, targets, self.ridge)
        return self

    def predict(self, X: Any) -> Float64[np.ndarray, "N ..."]:  # noqa: N803
        """The values that the program answers, `[N]` or `[N, m]` as in `fit`."""
        check_is_fitted(self)
        readings = self._checked(X, reset=False)
        folded = self.space_.vsa.unbind(self.program_.double(), self.space_.results.roles)
        answers = torch.cat([dots(block, folded) for block in self._conditions(self.space_, readings)])
        values = answers.numpy() * self.scale_ + self.mean_
        return values[:, 0] if self._flat else values
