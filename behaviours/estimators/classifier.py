"""A scikit-learn classifier that is one hypervector."""

from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
import torch
from jaxtyping import Float64, Int64, Shaped
from sklearn.base import ClassifierMixin
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted
from torch import Tensor
from torch.nn.functional import one_hot

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.estimators.base import AT_LEAST_1, QuantileEncoding, Rows
from behaviours.estimators.files import load_fitted, save_fitted
from behaviours.learning import Gradient, no_convergence_warnings
from behaviours.report import LearningReport
from behaviours.schema import Actuator
from behaviours.space import Space
from behaviours.storage import error_context


class BehaviourClassifier(ClassifierMixin, QuantileEncoding):
    """Classify rows of readings `[N, n]` with one hypervector of `dim` numbers.

    Each feature is a sensor, binned at the quantiles of its training values. Each dimension of a condition compares a
    few random sensors (at most `subset`) with random thresholds, and binds the outcomes; in a share of the dimensions,
    `oblique`, it compares a weighted sum of three sensors instead (`ObliqueFeatures`). The classes are random
    hypervectors. Only the program is trained, by `Gradient(sparse=True)`: class j scores
    `<condition ⊗ program, class_j>`. NaN means not observed, and is left out; values outside the range of the training
    rows are clipped to it.

    | parameter | meaning |
    |---|---|
    | `dim` | elements of the program |
    | `bins` | the most quantile bins per feature; their edges take features · bins floats |
    | `subset` | the most features that interact in one dimension |
    | `oblique` | the share of weighted sums; None takes 0, 1/4 or 1/2, see below |
    | `epochs`, `learning_rate` | of the gradient descent |
    | `batch_size` | its rows per step; "auto" takes a 16th of the distinct rows, at least 16 and at most 128 |
    | `validation_fraction` | with a share above 0, so many rows are held back, and the best program on them is taken |
    | `patience` | with it, training stops after so many epochs without a better program |
    | `random_state` | the seed of codebooks and batches |
    | `verbose` | 1 prints the progress of the training |

    Boxes suit what depends on single readings, weighted sums what changes gradually in any direction. With
    `oblique=None` at most 1,000 rows decide: each is predicted by a ridge regression on all others, and the share with
    the smallest squared error is taken if its error is at least a twentieth below that of boxes alone.

    The codebook takes about 17 · `subset` · `dim` bytes, for any number of bins and features. A row with a
    `sample_weight` of 2 counts as two equal rows; the order of the rows does not matter. If `fit` or `partial_fit`
    fails, the estimator is not changed.

    Fitted attributes: `classes_` `[K]`, `oblique_`, `behaviour_` (a `Behaviour`, whose `program` is the hypervector),
    `n_features_in_`.
    """

    _parameter_constraints: ClassVar[dict[str, Any]] = {
        **QuantileEncoding._parameter_constraints,
        "epochs": AT_LEAST_1,
        "batch_size": [*AT_LEAST_1, StrOptions({"auto"})],
        "learning_rate": [Interval(Real, 0, None, closed="neither")],
        "validation_fraction": [Interval(Real, 0, 1, closed="left")],
        "patience": AT_LEAST_1,
    }

    def __init__(
        self,
        dim: int = 4000,
        *,
        bins: int = 4096,
        subset: int = 2,
        oblique: float | None = None,
        epochs: int = 50,
        batch_size: int | Literal["auto"] = "auto",
        learning_rate: float = 0.05,
        validation_fraction: float = 0.0,
        patience: int = 10,
        random_state: Any = None,
        verbose: int = 0,
    ) -> None:
        self.dim = dim
        self.bins = bins
        self.subset = subset
        self.oblique = oblique
        self.epochs = epochs
        self.batch_size = batch_size
        self.learning_rate = learning_rate
        self.validation_fraction = validation_fraction
        self.patience = patience
        self.random_state = random_state
        self.verbose = verbose

    @no_convergence_warnings()
    def fit(self, X: Any, y: Any, sample_weight: Any = None) -> Self:
        """Train the program on rows `X` `[N, n]` and labels `y` `[N]`, which count as `sample_weight` `[N]` says.

        Raises `ValueError` for fewer than two classes, infinite values, rows of NaN only, features whose range is no
        finite float, weights that are negative or all 0, a `validation_fraction` that leaves no row to train on or
        none to validate with, and invalid parameters.
        """
        with self._all_or_nothing():
            self.check_parameters()
            readings, y = self._checked(X, y)
            check_classification_targets(y)
            self.classes_, labels = np.unique(y, return_inverse=True)
            rows = self._rows(readings, labels, sample_weight)
            if len(held := np.unique(rows.targets)) < 2:
                raise ValueError(
                    f"a classifier needs at least 2 classes; the data hold one class, {self.classes_[held[0]]!r}"
                )
            self.classes_, labels = self.classes_[held], np.searchsorted(held, rows.targets)
            space = self._class_space(rows._replace(targets=labels))
            shown = Demonstrations(torch.tensor(rows.readings), torch.tensor(labels))
            rule = self._rule(space.seed, len(rows.weights))
            behaviour = rule.fit(space, shown, self._progress(), torch.from_numpy(rows.weights))
            self.behaviour_ = _counted(behaviour, rows)
        return self

    @no_convergence_warnings()
    def partial_fit(self, X: Any, y: Any, classes: Any = None, sample_weight: Any = None) -> Self:
        """Continue training with rows `X` `[N, n]` and labels `y` `[N]`; the first call needs all `classes`.

        The bin edges come from the first call, whose readings should span those of later calls, since values outside
        their range are clipped to it. Each call trains for `epochs` on its rows alone, which may make the program
        forget earlier rows: take few epochs if each call shows one class. `sample_weight` `[N]` is about the rows of
        this call.

        Raises `ValueError` for labels that are not in `classes`, and where `fit` does.
        """
        with self._all_or_nothing():
            self.check_parameters()
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
            rows = self._rows(readings, np.searchsorted(self.classes_, y), sample_weight)
            before = self._untrained(self._class_space(rows)) if first else self.behaviour_
            # Each call has another seed, so that it visits its rows in another order.
            rule = self._rule(before.space.seed + before.report.updates, len(rows.weights))
            shown = Demonstrations(torch.tensor(rows.readings), torch.tensor(rows.targets))
            behaviour = rule.partial_fit(before, shown, self._progress(), torch.from_numpy(rows.weights))
            self.behaviour_ = _counted(behaviour, rows)
        return self

    def check_parameters(self) -> None:
        """See `QuantileEncoding.check_parameters`."""
        super().check_parameters()
        self._rule(seed=0, rows=1)

    def _class_space(self, rows: Rows) -> Space:
        count = len(self.classes_)
        labels = torch.from_numpy(rows.targets)[:, 0]
        actuators = [Actuator("class", 0, count - 1, levels=count)]
        return self._space(rows, actuators, lambda chosen: one_hot(labels[chosen], count).double())

    def _rule(self, seed: int, rows: int) -> Gradient:
        """The rule that trains on so many distinct rows."""
        names = ("epochs", "batch_size", "learning_rate", "validation_fraction", "patience")
        options = {name: getattr(self, name) for name in names}
        if self.batch_size == "auto":
            options["batch_size"] = min(128, max(16, rows // 16))
        return Gradient(**options, sparse=True, seed=seed)

    def _untrained(self, space: Space) -> Behaviour:
        """A behaviour that has all classes as results, and no known conditions."""
        zeros = torch.zeros(space.vsa.dim)
        known = zeros.to(space.vsa.accumulator)
        levels = torch.arange(len(self.classes_))[:, None]
        return Behaviour(space, zeros, known, levels, LearningReport(Gradient.name, samples=0, new=0, epochs=0))

    def _scores(self, X: Any) -> Float64[np.ndarray, "N K"]:
        check_is_fitted(self)
        readings = self._checked(X, reset=False)
        behaviour = self.behaviour_
        # In float64 the scores of a row do not visibly depend on the other rows of the batch.
        readout = behaviour.readout().of(behaviour.program.double())
        rows = [readout(block) for block in self._conditions(behaviour.space, readings)]
        # The clean-up memory is in order of first appearance, the columns in order of the classes.
        columns: Int64[Tensor, "K"] = behaviour.results[:, 0].argsort()
        return torch.cat(rows)[:, columns].numpy()

    def decision_function(self, X: Any) -> Float64[np.ndarray, "N ..."]:
        """The score of each class, `[N, K]`; for two classes, the score of the second less that of the first, `[N]`."""
        scores = self._scores(X)
        return scores[:, 1] - scores[:, 0] if len(self.classes_) == 2 else scores

    def predict_proba(self, X: Any) -> Float64[np.ndarray, "N K"]:
        """The softmax of the scores, `[N, K]`, which the loss of the training uses."""
        return torch.softmax(torch.from_numpy(self._scores(X)), 1).numpy()

    def predict(self, X: Any) -> Shaped[np.ndarray, "N"]:
        """The class with the highest score, `[N]`."""
        best = self._scores(X).argmax(1)
        return self.classes_[best]

    def save(self, path: str | Path) -> Path:
        """Write parameters, labels, codebooks and program to one safetensors file, completely or not at all.

        The same classifier gives the same bytes, and `load` reads them; no pickles. Raises `ValueError` if
        `random_state` is a generator or if labels are neither strings nor numbers, and `NotFittedError` before `fit`.
        """
        check_is_fitted(self)
        behaviour = self.behaviour_
        behaviour.check()
        tensors = {"program": behaviour.program, "known": behaviour.known, "results": behaviour.results}
        about = {"classes": _classes_to_dict(self.classes_), "report": behaviour.report.to_dict()}
        return save_fitted(path, self, behaviour.space, tensors, about)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a file that `save` wrote. Raises `ValueError` that names the file and what in it is wrong."""

        def restore(model: Self, space: Space, tensors: dict[str, Tensor], about: dict[str, Any]) -> None:
            with error_context("classes"):
                model.classes_ = _classes_from_dict(about["classes"])
            program, known, results = (tensors[name] for name in ("program", "known", "results"))
            model.behaviour_ = Behaviour(space, program, known, results, LearningReport(**about["report"]))
            if sorted(model.behaviour_.results[:, 0].tolist()) != list(range(len(model.classes_))):
                raise ValueError(f"the results do not match the {len(model.classes_)} classes")

        return load_fitted(path, cls, ("program", "known", "results"), restore)


_LABELS = "biufU"
"""The kinds of NumPy types of labels that a file holds, next to objects that are strings."""


def _classes_to_dict(classes: np.ndarray) -> dict[str, Any]:
    values = classes.tolist()
    if classes.dtype.kind not in _LABELS and not all(isinstance(value, str) for value in values):
        raise ValueError(f"a file holds labels that are strings, numbers or booleans; got {values!r:.200}")
    return {"dtype": classes.dtype.str, "values": values}


def _classes_from_dict(data: dict[str, Any]) -> Shaped[np.ndarray, "K"]:
    dtype, values = np.dtype(data["dtype"]), list(data["values"])
    if dtype.kind not in _LABELS and not (dtype.kind == "O" and all(isinstance(value, str) for value in values)):
        raise ValueError(f"labels of type {dtype} are not strings, numbers or booleans")
    classes = np.array(values, dtype=dtype)
    if (
        classes.ndim != 1
        or len(classes) < 2
        or classes.tolist() != values
        or not np.array_equal(np.unique(classes), classes)
    ):
        raise ValueError(f"labels must be at least 2, distinct and sorted; got {values!r:.200}")
    return classes


def _counted(behaviour: Behaviour, rows: Rows) -> Behaviour:
    """The behaviour with a report that counts equal rows each."""
    again, report = rows.given - len(rows.weights), behaviour.report
    behaviour.report = replace(report, samples=report.samples + again, truly_known=report.truly_known + again)
    return behaviour
