"""What the estimators for scikit-learn share: parameters, and sensors that are binned at quantiles."""

import math
import operator
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Real
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64, Shaped
from sklearn.base import BaseEstimator
from sklearn.utils import check_random_state
from sklearn.utils.validation import validate_data
from torch import Tensor

from behaviours.edges import quantile_edges
from behaviours.progress import Progress, no_progress
from behaviours.schema import Actuator, Schema, Sensor
from behaviours.space import Space
from torchvsa import MAP
from torchvsa._memory_limit import require_memory
from torchvsa.encoders import Balanced, ThresholdFeatures

_ROWS = 1024
"""Rows encoded at once."""
_EDGE_BYTES = 24
"""A bin's edge is kept as a float64, twice while all of them are put together and once more while one is found."""


class QuantileEncoding(BaseEstimator):
    """The base of both estimators: checks parameters, and bins sensors at the quantiles of their readings."""

    dim: int
    bins: int
    subset: int
    random_state: Any
    verbose: int

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags

    def _check_parameters(self) -> None:
        """Raise `ValueError`, naming the parameter, unless fitting can work with these."""
        for name in ("dim", "bins", "subset"):
            self._whole(name)
        self._whole("verbose", 0)
        try:
            check_random_state(self.random_state)
        except ValueError as error:
            raise ValueError(f"random_state={self.random_state!r} is no seed: {error}") from error

    def _whole(self, name: str, at_least: int = 1) -> int:
        """The parameter `name` as a plain integer."""
        given = getattr(self, name)
        try:
            value = operator.index(given)
        except TypeError:
            value = at_least - 1
        # `verbose=True` is common usage; no other count is a boolean.
        if value < at_least or (isinstance(given, bool | np.bool_) and name != "verbose"):
            raise ValueError(f"{name} must be a whole number, at least {at_least}; got {given!r}")
        return value

    def _positive(self, name: str) -> float:
        """The parameter `name` as a float above 0."""
        given = getattr(self, name)
        try:
            number = isinstance(given, Real) and not isinstance(given, bool | np.bool_)
            value = float(given) if number else math.nan
        except OverflowError:
            value = math.inf
        if not 0 < value < math.inf:
            raise ValueError(f"{name} must be a finite number above 0; got {given!r}")
        return value

    @contextmanager
    def _all_or_nothing(self) -> Iterator[None]:
        """Leave the estimator exactly as it was if what is done within fails."""
        before = dict(self.__dict__)
        try:
            yield
        except BaseException:
            self.__dict__.clear()
            self.__dict__.update(before)
            raise

    def _progress(self) -> Progress:
        """Prints the share of the work that is done, at each further tenth, if `verbose` asks for it."""
        if not self._whole("verbose", 0):
            return no_progress
        printed = -1

        def show(share: float) -> None:
            nonlocal printed
            tenth = int(10 * share)
            if tenth > printed:
                printed = tenth
                print(f"[{type(self).__name__}] {share:.0%} done", flush=True)

        return show

    def _space(self, readings: Float64[np.ndarray, "N n"], actuators: list[Actuator]) -> Space:
        """Codebooks for these readings; the edges of the bins see nothing but the readings."""
        bins, features = self._whole("bins"), readings.shape[1]
        require_memory(
            _EDGE_BYTES * bins * features,
            f"{type(self).__name__}: the edges of bins={bins:,} for each of {features} features",
            "take fewer bins",
        )
        seed = int(check_random_state(self.random_state).randint(2**31 - 1))
        names = getattr(self, "feature_names_in_", [f"x{i}" for i in range(features)])
        sensors, edges = [], []
        for name, column in zip(names, torch.tensor(readings).T, strict=True):
            seen = column[~column.isnan()]
            low, high = (seen.min().item(), seen.max().item()) if len(seen) else (0.0, 0.0)
            low, high = (low, high) if low < high else _around(low)
            sensors.append(Sensor(str(name), low, high, out_of_range="clip"))
            edges.append((quantile_edges(seen, bins) - low) / (high - low))
        vsa = MAP(self._whole("dim"), dtype=torch.int8)
        encoder = ThresholdFeatures(vsa, features, bins, self._whole("subset"), edges)
        codes = Balanced(vsa, max(actuator.levels for actuator in actuators))
        return Space(Schema(sensors, actuators), encoder, seed=seed, command_codes=codes)

    def _conditions(
        self, space: Space, readings: Float64[np.ndarray, "N n"], progress: Progress = no_progress
    ) -> list[Shaped[Tensor, "batch d"]]:
        """The encoded rows, some at a time; raises for rows in which nothing was observed."""
        blind = np.isnan(readings).all(1)
        if blind.any():
            raise ValueError(f"row {int(blind.argmax())} has no observed feature: all of its values are NaN")
        blocks = torch.tensor(readings).split(_ROWS)
        conditions = []
        for done, block in enumerate(blocks, 1):
            conditions.append(space.encode(space.cells(block)))
            progress(done / len(blocks))
        return conditions

    def _checked(self, *data: Any, **options: Any) -> Any:
        """Readings `[N, n]` as float64, and targets where they are given, as scikit-learn checks them."""
        # scikit-learn sums the readings first, which overflows for the largest floats.
        with np.errstate(over="ignore", invalid="ignore"):
            return validate_data(self, *data, dtype=np.float64, order="C", ensure_all_finite="allow-nan", **options)


def _around(value: float) -> tuple[float, float]:
    """A range around a constant reading, which has none, though a sensor needs one."""
    # Beyond 2^53 a float less 1 is the same float.
    margin = max(1.0, 4 * math.ulp(value))
    most = sys.float_info.max
    return max(value - margin, -most), min(value + margin, most)
