"""Threshold features: blind boxes of sensors, one per dimension."""

from itertools import combinations

import pytest
import torch
from readings import centres, rows, seeded
from spaces import with_negatives
from torch.testing import assert_close

import torchvsa
from torchvsa import VSA
from torchvsa.encoders import Balanced, ThresholdFeatures


def asking(encode: ThresholdFeatures) -> torch.Tensor:
    """The dimensions that are not constant."""
    return encode.threshold[0] < encode.bins - 1


def test_one_dimension_in_sixteen_is_constant() -> None:
    encode = ThresholdFeatures(torchvsa.MAP(4000), 3, 12, seed=0)
    x = torch.rand(2000, 3, generator=seeded(1))
    constant = (encode(x) == encode.start_codes).all(0)
    assert constant[~asking(encode)].all()
    assert (~asking(encode)).float().mean() == pytest.approx(1 / 16, abs=0.012)


@with_negatives
def test_one_sensor_has_the_kernel_of_thermometer_codes(vsa: VSA) -> None:
    codes = ThresholdFeatures(vsa, 1, 11, seed=0)(centres(torch.arange(11)[:, None], 11))
    distances = (torch.arange(11)[:, None] - torch.arange(11)).abs()
    # Where elements differ in size (HRR) the share that is negated weighs more or less.
    assert_close(vsa.similarity(codes[:, None], codes), 1 - 2 * 15 / 16 * distances / 10, atol=0.1, rtol=0)


def test_an_element_is_negated_where_all_of_its_sensors_are_on_their_sides() -> None:
    encode = ThresholdFeatures(torchvsa.MAP(300), 5, 20, subset=3, seed=0)
    cells = torch.randint(-1, 20, (40, 5), generator=seeded(1))
    for row, code in zip(cells.tolist(), encode(centres(cells, 20)), strict=True):
        for d in range(300):
            asked = [
                (row[s] > t) == bool(up)
                for s, t, up in zip(encode.sensor[:, d], encode.threshold[:, d], encode.above[:, d], strict=True)
                if row[s] >= 0
            ]
            assert code[d] == encode.start_codes[d] * (-1 if asked and all(asked) else 1)


def test_thresholds_of_a_sensor_are_spread_evenly() -> None:
    encode = ThresholdFeatures(torchvsa.MAP(4000), 4, 1001, subset=1, seed=0)
    for sensor in range(4):
        marks = encode.threshold[0][(encode.sensor[0] == sensor) & asking(encode)].sort().values
        assert marks.diff().max() <= 2 * 1000 / len(marks) + 1
        assert 0 <= marks.min() <= marks.max() < 1000


def test_subsets_are_of_distinct_sensors_and_of_every_size() -> None:
    encode = ThresholdFeatures(torchvsa.MAP(3000), 6, 9, subset=3, seed=0)
    sizes = torch.tensor([len(set(column)) for column in encode.sensor.T.tolist()])
    assert_close(sizes.bincount()[1:] / 3000, torch.full((3,), 1 / 3), atol=0.04, rtol=0)
    assert ThresholdFeatures(torchvsa.MAP(10), 2, 9, subset=5, seed=0).sensor.shape == (2, 10)


@with_negatives
def test_nothing_observed_is_the_start(vsa: VSA) -> None:
    encode = ThresholdFeatures(vsa, 3, 7, seed=0)
    assert torch.equal(encode(torch.full((1, 3), torch.nan))[0], encode.start_codes)


def test_a_sensor_that_is_never_asked_changes_nothing() -> None:
    """Equal to an encoder whose dimensions ask the others alone."""
    vsa = torchvsa.MAP(400)
    encode, other = (ThresholdFeatures(vsa, 3, 9, 1, seed=0) for _ in range(2))
    x = rows(20, 3, missing=0)
    x[:, 2] = torch.nan
    asks = encode.sensor[0] == 2
    other.threshold[:, asks], other.above[:, asks] = 8, True  # constant
    assert torch.equal(encode(x), other(x))


def test_edges_are_the_lower_ends_of_their_bins() -> None:
    edges = [torch.tensor([0.2, 0.5]), torch.tensor([0.1, 0.1, 0.9])]
    encode = ThresholdFeatures(torchvsa.MAP(100), 2, 4, edges=edges, seed=0)
    x = torch.tensor([[0.0, 0.0], [0.2, 0.1], [0.49, 0.5], [0.5, 0.9], [1.0, 1.0], [torch.nan, 0.95]])
    assert encode.cells(x).tolist() == [[0, 0], [1, 2], [1, 2], [2, 3], [2, 3], [-1, 3]]
    assert torch.equal(encode(x), encode.encode(encode.cells(x)))


def test_even_edges_are_the_bins_without_edges() -> None:
    vsa, edges = torchvsa.MAP(300), [torch.arange(1, 8, dtype=torch.float64) / 8] * 3
    x = torch.cat([rows(50, 3), torch.arange(9)[:, None].expand(9, 3) / 8])
    plain, given = ThresholdFeatures(vsa, 3, 8, seed=0), ThresholdFeatures(vsa, 3, 8, edges=edges, seed=0)
    assert torch.equal(given(x), plain(x))
    plan = ThresholdFeatures.from_config(given.config(), vsa)
    assert not plan.drawn
    assert torch.equal(plan.take(given.state_dict())(x), plain(x))


@with_negatives
@pytest.mark.parametrize(("bins", "cosine"), [(2, -1), (3, -1 / 3), (4, -1 / 3), (5, -1 / 5), (6, -1 / 5)])
def test_balanced_codes_are_as_far_apart_as_they_can_be(vsa: VSA, bins: int, cosine: float, chance: float) -> None:
    codes = Balanced(vsa, bins, seed=0).codes
    for a, b in combinations(codes, 2):
        assert abs(vsa.similarity(a, b) - cosine) < chance
