"""The base of the scikit-learn estimators: parameters, and sensors that are binned at quantiles."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from numbers import Integral, Real
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from jaxtyping import Float64, Int64, Shaped
from sklearn.base import BaseEstimator
from sklearn.utils import check_random_state
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import (
    _check_sample_weight,  # pyright: ignore[reportPrivateUsage]  # scikit-learn documents no public one
    validate_data,
)
from torch import Tensor

from behaviours.edges import quantile_edges
from behaviours.estimators.shares import chosen_space, encoder, share_of, some
from behaviours.options import as_int
from behaviours.progress import Progress, in_steps, no_progress
from behaviours.schema import Actuator, Schema, Sensor
from behaviours.space import Space
from torchvsa import MAP
from torchvsa._memory_limit import require_memory
from torchvsa.encoders import Balanced

_ROWS = 1024
"""Rows encoded in one call; bounds the memory."""
_EDGE_BYTES = 24
"""The memory per edge: a float64, a copy while edges are joined, and one more while they are computed."""


AT_LEAST_1 = [Interval(Integral, 1, None, closed="left")]
"""The constraint of a parameter that is a whole number above 0."""


class Rows(NamedTuple):
    """Distinct training rows, in an order that depends on their values alone."""

    readings: Float64[np.ndarray, "N n"]
    targets: Shaped[np.ndarray, "N m"]
    weights: Float64[np.ndarray, "N"]
    given: int
    """The number of rows that they stand for: those whose weight is not 0."""


class QuantileEncoding(BaseEstimator):
    """The base of both estimators: checks parameters, and bins sensors at the quantiles of their readings."""

    _parameter_constraints: ClassVar[dict[str, Any]] = {
        "dim": AT_LEAST_1,
        "bins": AT_LEAST_1,
        "subset": AT_LEAST_1,
        "oblique": [Interval(Real, 0, 1, closed="both"), None],
        "random_state": ["random_state"],
        "verbose": ["verbose"],
    }
    dim: int
    bins: int
    subset: int
    oblique: float | None
    random_state: Any
    verbose: int
    n_features_in_: int
    feature_names_in_: np.ndarray
    oblique_: float

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags

    def check_parameters(self) -> None:
        """Raise `ValueError`, naming the parameter, for invalid parameters."""
        self._validate_params()
        # scikit-learn takes True for 1, and does not limit the size of numbers.
        for name in ("dim", "bins", "subset"):
            self._whole(name)
        self._whole("verbose", 0)

    def _whole(self, name: str, at_least: int = 1) -> int:
        """The parameter `name` as an int."""
        given = getattr(self, name)
        if name == "verbose" and isinstance(given, bool | np.bool_):
            return int(given)  # `verbose=True` is common usage
        return as_int(name, given, at_least)

    @contextmanager
    def _all_or_nothing(self) -> Iterator[None]:
        """Restore the attributes of the estimator if the body raises."""
        before = dict(self.__dict__)
        try:
            yield
        except BaseException:
            self.__dict__.clear()
            self.__dict__.update(before)
            raise

    def _progress(self) -> Progress:
        """A callback that prints each completed tenth of the work if `verbose` is set."""
        if not self._whole("verbose", 0):
            return no_progress
        return in_steps(lambda share: print(f"[{type(self).__name__}] {share:.0%} done", flush=True), 10)

    def _rows(self, readings: Float64[np.ndarray, "N n"], targets: np.ndarray, sample_weight: Any) -> Rows:
        """The distinct rows of readings and targets `[N]` or `[N, m]`; their weights are added up.

        A row of weight 2 is therefore the same as two rows, a row of weight 0 is none, and the order of rows does not
        matter. Raises `ValueError` for weights that are negative, not finite, or all 0.
        """
        weights = np.ones(len(readings))
        if sample_weight is not None:
            weights = _check_sample_weight(sample_weight, readings, dtype=np.float64, ensure_non_negative=True)
        _check_observed(readings)
        counted = weights > 0
        readings, targets, weights = readings[counted], targets[counted].reshape(counted.sum(), -1), weights[counted]
        # Equal rows have equal bytes: one NaN, and no -0.0.
        table = np.c_[np.where(np.isnan(readings), np.nan, readings), targets] + 0.0
        keys = table.view(np.dtype((np.void, table.dtype.itemsize * table.shape[1])))[:, 0]
        _, first, index = np.unique(keys, return_index=True, return_inverse=True)
        return Rows(readings[first], targets[first], np.bincount(index, weights), len(weights))

    def _space(
        self, rows: Rows, actuators: list[Actuator], wanted: Callable[[Int64[Tensor, "k"]], Float64[Tensor, "k m"]]
    ) -> Space:
        """A space for these rows, and `oblique_`.

        `wanted` gives the targets of some rows, which decide nothing but the share of weighted sums; the bin edges
        depend on readings and weights alone.
        """
        bins, features = self._whole("bins"), rows.readings.shape[1]
        require_memory(
            _EDGE_BYTES * bins * features,
            f"{type(self).__name__}: the edges of bins={bins:,} for each of {features} features",
            "take fewer bins",
        )
        seed = int(check_random_state(self.random_state).randint(2**31 - 1))
        names = getattr(self, "feature_names_in_", [f"x{i}" for i in range(features)])
        sensors, edges, weights = [], [], torch.from_numpy(rows.weights)
        for name, column in zip(names, torch.tensor(rows.readings).T, strict=True):
            seen = ~column.isnan()
            observed = column[seen]
            low, high = (observed.min().item(), observed.max().item()) if len(observed) else (0.0, 0.0)
            low, high = (low, high) if low < high else _around(low)
            sensors.append(Sensor(str(name), low, high, out_of_range="clip"))
            edges.append((quantile_edges(observed, bins, weights[seen]) - low) / (high - low))
        vsa = MAP(self._whole("dim"), dtype=torch.int8)
        codes = Balanced(vsa, max(actuator.levels for actuator in actuators))
        schema = Schema(sensors, actuators)
        chosen = some(len(rows.readings))
        readings = torch.from_numpy(rows.readings)[chosen]
        examples = schema.normalise(readings)

        def of(share: float) -> Space:
            made = encoder(vsa, share, examples, bins, self._whole("subset"), edges)
            return Space(schema, made, seed=seed, command_codes=codes)

        if self.oblique is None:
            space = chosen_space(of, readings, wanted(chosen), weights[chosen])
        else:
            space = of(self.oblique)
        self.oblique_ = share_of(space)
        return space

    def _conditions(
        self, space: Space, readings: Float64[np.ndarray, "N n"], progress: Progress = no_progress
    ) -> list[Shaped[Tensor, "batch d"]]:
        """The encoded rows in blocks. Raises `ValueError` for a row in which nothing was observed."""
        _check_observed(readings)
        blocks = torch.tensor(readings).split(_ROWS)
        conditions = []
        for number, block in enumerate(blocks, 1):
            conditions.append(space.encode(space.cells(block)))
            progress(number / len(blocks))
        return conditions

    def _checked(self, *data: Any, **options: Any) -> Any:
        """Readings `[N, n]` as float64, and targets if they are given, validated by scikit-learn."""
        # Its validation sums the readings, which overflows for the largest floats.
        with np.errstate(over="ignore", invalid="ignore"):
            return validate_data(self, *data, dtype=np.float64, order="C", ensure_all_finite="allow-nan", **options)


def _check_observed(readings: Float64[np.ndarray, "N n"]) -> None:
    """Raise `ValueError` for a row in which nothing was observed."""
    unobserved = np.isnan(readings).all(1)
    if unobserved.any():
        raise ValueError(f"row {int(unobserved.argmax())} has no observed feature: all of its values are NaN")


def _around(value: float) -> tuple[float, float]:
    """A range around a constant reading, since the range of a sensor must not be empty."""
    # Above 2^53, subtracting 1 does not change a float.
    margin = max(1.0, 4 * math.ulp(value))
    most = sys.float_info.max
    return max(value - margin, -most), min(value + margin, most)
