"""Quantile edges, compared with a direct computation in fractions."""

from fractions import Fraction

import numpy as np
import pytest
import torch

from behaviours import quantile_edges
from torchvsa import MAP
from torchvsa.encoders import ThresholdFeatures


def by_counts(readings: list[float], bins: int) -> list[float]:
    """The edges by walking along the distinct values until there are more rows than wanted."""
    values = sorted(set(readings))
    edges = []
    for k in range(1, bins):
        below, above = 0, 0
        while below + readings.count(values[above]) <= Fraction(k * len(readings), bins):
            below, above = below + readings.count(values[above]), above + 1
        above = max(above, 1)
        edges.append((values[above - 1] + values[above]) / 2)
    return edges


@pytest.mark.parametrize("bins", [1, 2, 5, 8, 64, 100])
@pytest.mark.parametrize("most", [2, 6, 30, 1000])
def test_edges_divide_the_rows_between_distinct_values(bins: int, most: int) -> None:
    rng = np.random.default_rng(most)
    # Small values are frequent.
    readings = np.floor(most * rng.random(60) ** 3).tolist()
    assert quantile_edges(readings, bins).tolist() == by_counts(readings, bins)


def test_without_repetitions_the_bins_have_equal_counts() -> None:
    readings = torch.rand(60, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    counts = torch.bincount(torch.searchsorted(quantile_edges(readings, 12), readings, right=True))
    assert counts.tolist() == [5] * 12


def test_every_edge_separates_some_readings() -> None:
    readings = torch.tensor([-0.0, 0.0, 0.0, 0.0, 0.0, 3.0, float("nan")])
    assert quantile_edges(readings, 5).tolist() == [1.5] * 4
    assert quantile_edges([2.0] * 9, 5).tolist() == []
    assert quantile_edges([], 5).tolist() == []


def test_few_dimensions_are_constant_where_readings_repeat() -> None:
    rng = np.random.default_rng(0)
    readings = np.where(rng.random((500, 2)) < 0.8, 0, rng.integers(1, 17, (500, 2))) / 16
    edges = [quantile_edges(column, 256) for column in readings.T]
    encoder = ThresholdFeatures(MAP(2000, dtype=torch.int8), 2, 256, 1, edges, seed=0)
    conditions = encoder(torch.from_numpy(readings))
    constant = (conditions == conditions[0]).all(0).double().mean()
    # One dimension in 16 has no comparison.
    assert 0.04 < constant < 0.09
