"""Weighted sums against thresholds, alone and beside other encoders."""

import math
import re
from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch.testing import assert_close

import torchvsa
from torchvsa import BSC, HRR, MAP
from torchvsa.encoders import Concatenated, History, Level, ObliqueFeatures, Sum, ThresholdFeatures

NAN = torch.nan


def test_each_element_is_negated_above_its_threshold() -> None:
    encode = ObliqueFeatures(MAP(500, dtype=torch.int8), 4, 2, seed=3)
    x = torch.rand(40, 4, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    x[:10, 1] = NAN
    x[20] = NAN
    found = encode(x).numpy()
    sensor, weight, threshold, start = (
        tensor.numpy() for tensor in (encode.sensor, encode.weight, encode.threshold, encode.start_codes)
    )
    for row, readings in enumerate(x.numpy()):
        for dim in range(500):
            seen = readings[sensor[:, dim]]
            above = np.dot(np.where(np.isnan(seen), 0.5, seen), weight[:, dim]) > threshold[dim]
            negated = above and not np.isnan(seen).all()
            assert found[row, dim] == (-start[dim] if negated else start[dim])


def test_the_kernel_depends_on_the_distance_in_any_direction() -> None:
    # The same for boxes of one sensor is the distance along the axes.
    vsa = MAP(20000, dtype=torch.int8)
    encode = ObliqueFeatures(vsa, 2, rows=torch.rand(5000, 2, generator=torch.Generator().manual_seed(1)), seed=0)
    turns = torch.arange(8, dtype=torch.float64) * math.pi / 4
    ring = 0.5 + 0.1 * torch.stack([turns.cos(), turns.sin()], 1)
    centre = encode(torch.full((1, 2), 0.5, dtype=torch.float64))[0]
    found = vsa.similarity(encode(ring), centre)
    assert (found - found.mean()).abs().max() < 5 * (1 / 20000) ** 0.5
    farther = vsa.similarity(encode(0.5 + 2 * (ring - 0.5)), centre).mean()
    assert_close((1 - farther) / (1 - found.mean()), torch.tensor(2.0), atol=0.2, rtol=0)


def test_sensors_count_in_units_of_their_spread() -> None:
    vsa = MAP(20000, dtype=torch.int8)
    rows = torch.rand(5000, 2, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    rows[:, 1] = 0.5 + (rows[:, 1] - 0.5) / 10
    encode = ObliqueFeatures(vsa, 2, rows=rows, seed=0)
    x = torch.tensor([[0.5, 0.5], [0.6, 0.5], [0.5, 0.51]], dtype=torch.float64)
    codes = encode(x)
    wide, narrow = vsa.similarity(codes[1:], codes[0])
    assert_close(wide, narrow, atol=5 * (1 / 20000) ** 0.5, rtol=0)
    assert wide < 0.97


def test_a_sensor_that_never_changed_and_one_never_seen_do_no_harm() -> None:
    rows = torch.tensor([[0.1, 0.7, NAN], [0.9, 0.7, NAN]], dtype=torch.float64)
    encode = ObliqueFeatures(MAP(200, dtype=torch.int8), 3, rows=rows, seed=0)
    encode.check()
    assert encode.center.tolist() == [0.5, 0.7, 0.5]
    assert not torch.equal(encode(rows)[0], encode(rows)[1])


def test_codes_of_several_encoders_are_side_by_side() -> None:
    boxes, sums = ThresholdFeatures(MAP(60), 3, 9, seed=1), ObliqueFeatures(MAP(40), 3, seed=2)
    both = Concatenated([boxes, sums])
    assert both.drawn
    assert both.vsa == MAP(100)
    x = torch.rand(20, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    x[:5, 0] = NAN
    assert torch.equal(both(x), torch.cat([boxes(x), sums(x)], 1))
    # A space draws the plans of both.
    plan = Concatenated([ThresholdFeatures(MAP(60), 3, 9), ObliqueFeatures(MAP(40), 3)])
    assert not plan.drawn
    assert torchvsa.encoders.encoder(plan.config(), MAP(100)).layout() == plan.layout()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ObliqueFeatures(MAP(8), 2, rows=torch.rand(5, 3)), ["examples [k, 2]", "[5, 3]"]),
        (lambda: ObliqueFeatures(MAP(8), 2, rows=torch.rand(0, 2)), ["examples [k, 2]", "[0, 2]"]),
        (lambda: ObliqueFeatures(MAP(8), 2, rows=torch.tensor([[0, 3.0]])), ["in [0, 1]", "Schema.normalise"]),
        (lambda: ObliqueFeatures(MAP(8), 2, 0), ["subset", "at least 1"]),
        (lambda: Concatenated([]), ["at least one encoder"]),
        (lambda: Concatenated([ObliqueFeatures(MAP(8), 2), ObliqueFeatures(BSC(8), 2)]), ["dimension", "BSC"]),
        (lambda: Concatenated([ObliqueFeatures(MAP(8), 2), ObliqueFeatures(MAP(8), 3)]), ["same sensors", "3 and 2"]),
        (lambda: Concatenated([Sum(Level(HRR(8), 3), 2)]), ["element-wise", "HRR"]),
        (lambda: Concatenated([History(ObliqueFeatures(MAP(8), 2), [1])]), ["past readings", "history"]),
        (
            lambda: Concatenated.from_config(Concatenated([ObliqueFeatures(MAP(8), 2)]).config(), MAP(9)),
            ["[8]", "add up to 9"],
        ),
    ],
)
def test_what_does_not_fit_is_named(make: Callable[[], object], words: list[str]) -> None:
    with pytest.raises(ValueError, match=".*".join(map(re.escape, words))):
        make()
