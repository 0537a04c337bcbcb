"""Thresholds: blind boxes of sensors, one per dimension."""

from itertools import combinations

import pytest
import torch
from torch.testing import assert_close

import torchvsa
from torchvsa import VSA, Thresholds, balanced


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def asking(encode: Thresholds) -> torch.Tensor:
    """The dimensions that are not constant."""
    return encode.threshold[0] < encode.levels - 1


def test_one_dimension_in_sixteen_is_constant() -> None:
    encode = Thresholds(torchvsa.MAP(4000), 3, 12, generator=seeded())
    rows = torch.randint(0, 12, (2000, 3), generator=seeded(1))
    constant = (encode(rows) == encode.start).all(0)
    assert constant[~asking(encode)].all()
    assert (~asking(encode)).float().mean() == pytest.approx(1 / 16, abs=0.012)


def test_one_sensor_has_the_kernel_of_thermometer_codes(vsa: VSA) -> None:
    codes = Thresholds(vsa, 1, 11, generator=seeded())(torch.arange(11)[:, None])
    distances = (torch.arange(11)[:, None] - torch.arange(11)).abs()
    # Where elements differ in size (HRR) the share that is negated weighs more or less.
    assert_close(vsa.similarity(codes[:, None], codes), 1 - 2 * 15 / 16 * distances / 10, atol=0.1, rtol=0)


def test_an_element_is_negated_where_all_of_its_sensors_are_on_their_sides() -> None:
    encode = Thresholds(torchvsa.MAP(300), 5, 20, subset=3, generator=seeded())
    rows = torch.randint(-1, 20, (40, 5), generator=seeded(1))
    for row, code in zip(rows.tolist(), encode(rows), strict=True):
        for d in range(300):
            asked = [
                (row[s] > t) == bool(up)
                for s, t, up in zip(encode.sensor[:, d], encode.threshold[:, d], encode.above[:, d], strict=True)
                if row[s] >= 0
            ]
            assert code[d] == encode.start[d] * (-1 if asked and all(asked) else 1)


def test_thresholds_of_a_sensor_are_spread_evenly() -> None:
    encode = Thresholds(torchvsa.MAP(4000), 4, 1001, subset=1, generator=seeded())
    for sensor in range(4):
        marks = encode.threshold[0][(encode.sensor[0] == sensor) & asking(encode)].sort().values
        assert marks.diff().max() <= 2 * 1000 / len(marks) + 1
        assert 0 <= marks.min() <= marks.max() < 1000


def test_subsets_are_of_distinct_sensors_and_of_every_size() -> None:
    encode = Thresholds(torchvsa.MAP(3000), 6, 9, subset=3, generator=seeded())
    sizes = torch.tensor([len(set(column)) for column in encode.sensor.T.tolist()])
    assert_close(sizes.bincount()[1:] / 3000, torch.full((3,), 1 / 3), atol=0.04, rtol=0)
    assert Thresholds(torchvsa.MAP(10), 2, 9, subset=5, generator=seeded()).sensor.shape == (2, 10)


def test_rows_do_not_depend_on_the_batch(vsa: VSA) -> None:
    encode = Thresholds(vsa, 3, 7, generator=seeded())
    rows = torch.randint(-1, 7, (20, 3), generator=seeded(1))
    assert torch.equal(torch.cat([encode(part) for part in rows.split(3)]), encode(rows))
    assert encode(rows[:0]).shape == (0, vsa.dim)
    assert torch.equal(encode(torch.full((1, 3), -1))[0], encode.start)


def test_arguments_that_make_no_sense() -> None:
    vsa = torchvsa.MAP(10)
    with pytest.raises(ValueError, match="at least one sensor and one level; got 0 and 3"):
        Thresholds(vsa, 0, 3)
    with pytest.raises(ValueError, match="largest number of sensors bound in one dimension, at least 1; got 0"):
        Thresholds(vsa, 2, 3, subset=0)
    with pytest.raises(torchvsa.ShapeError, match=r"\[batch, 2\].*got \(4, 3\)"):
        Thresholds(vsa, 2, 3)(torch.zeros(4, 3, dtype=torch.int64))


@pytest.mark.parametrize(("levels", "cosine"), [(2, -1), (3, -1 / 3), (4, -1 / 3), (5, -1 / 5), (6, -1 / 5)])
def test_balanced_codes_are_as_far_apart_as_they_can_be(vsa: VSA, levels: int, cosine: float, chance: float) -> None:
    codes = balanced(vsa, levels, seeded())
    for a, b in combinations(codes, 2):
        assert abs(vsa.similarity(a, b) - cosine) < chance
