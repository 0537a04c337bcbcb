"""Value encoders: the kernel that each kind must show, and the bins of readings at their edges."""

import math
from itertools import pairwise
from typing import Any

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from readings import centres, seeded
from spaces import with_negatives
from torch import Tensor
from torch.testing import assert_close

import torchvsa
from torchvsa import VSA
from torchvsa.encoders import (
    Balanced,
    Binned,
    Circular,
    FractionalPower,
    Level,
    Lookup,
    Product,
    RandomFourier,
    Thermometer,
    ThresholdFeatures,
)

KINDS: tuple[Any, ...] = (Lookup, Level, Balanced, Thermometer, Circular)


def kernel(vsa: VSA, codes: Tensor) -> Tensor:
    return vsa.similarity(codes[:, None], codes)


def distances(bins: int) -> Tensor:
    return (torch.arange(bins)[:, None] - torch.arange(bins)).abs()


def test_lookup_codes_resemble_only_themselves(vsa: VSA, chance: float) -> None:
    assert_close(kernel(vsa, Lookup(vsa, 9, 0).codes), torch.eye(9), atol=chance, rtol=0)


# 3 and 4 divide 12 bins into stretches; 5 leaves a part of one; 20 reaches beyond the last bin.
@pytest.mark.parametrize("span", [None, 2, 3, 4, 5, 12, 20])
def test_level_codes_fall_linearly_over_their_span(vsa: VSA, chance: float, span: int | None) -> None:
    expected = (1 - distances(13) / (span or 12)).clamp(min=0)
    assert_close(kernel(vsa, Level(vsa, 13, span, 0).codes), expected, atol=chance, rtol=0)


def test_a_span_of_one_is_the_lookup_table(vsa: VSA, chance: float) -> None:
    codes = Level(vsa, 9, 1, 0).codes
    assert_close(kernel(vsa, codes), torch.eye(9), atol=chance, rtol=0)
    assert torch.equal(codes, Lookup(vsa, 9, 0).codes)


@pytest.mark.parametrize("dim", [1, 7, 1000, 1001])
@pytest.mark.parametrize("bins", [2, 4, 8])
def test_exactly_the_due_elements_have_changed_over(dim: int, bins: int) -> None:
    codes = Level(torchvsa.HRR(dim), bins, seed=0).codes
    steps = bins - 1
    # Elements of two normal vectors differ, so that each element tells which end it comes from.
    changed = [(code != codes[0]).sum().item() for code in codes]
    assert changed == [-(-dim * step // steps) for step in range(bins)]
    for before, after in pairwise(codes):
        assert ((before == codes[0]) | (after == codes[-1])).all()


@with_negatives
def test_thermometer_codes_fall_linearly_to_their_opposite(vsa: VSA, chance: float) -> None:
    expected = 1 - 2 * distances(11) / 10
    # Elements of equal size count exactly; where sizes differ (HRR), those that are negated weigh more or less.
    atol = 2 / vsa.dim if vsa.elementwise else chance
    assert_close(kernel(vsa, Thermometer(vsa, 11, 0).codes), expected, atol=atol + 1e-6, rtol=0)


@with_negatives
@pytest.mark.parametrize("bins", [2, 7, 12])
def test_circular_codes_fall_with_the_shorter_way_round(vsa: VSA, chance: float, bins: int) -> None:
    apart = torch.minimum(distances(bins), bins - distances(bins)) / bins
    atol = 4 / vsa.dim if vsa.elementwise else chance
    assert_close(kernel(vsa, Circular(vsa, bins, 0).codes), 1 - 2 * apart, atol=atol + 1e-6, rtol=0)


def test_the_ends_of_a_circle_are_one() -> None:
    encode = Circular(torchvsa.MAP(500), 8, 0)
    assert encode.cells(torch.tensor([0, 0.05, 0.9, 0.99, 1, 1.5, torch.nan])).tolist() == [0, 0, 7, 7, 0, 0, -1]
    assert torch.equal(*encode(torch.tensor([0.0, 1.0])))


@with_negatives
@pytest.mark.parametrize("kind", KINDS)
def test_one_code_per_bin_from_the_seed_alone(vsa: VSA, kind: Any) -> None:
    for bins in (1, 2, 5):
        codes = kind(vsa, bins, seed=0).codes
        assert codes.shape == (bins, vsa.dim)
        assert codes.dtype == vsa.dtype
        assert torch.equal(codes, kind(vsa, bins).draw(seeded()).codes)
        assert torch.equal(codes, kind(vsa, bins, seed=0)(centres(torch.arange(bins), bins)))
        assert not torch.equal(codes, kind(vsa, bins, seed=1).codes)


APART = torch.linspace(0, 1, 21, dtype=torch.float64)
SPACES = [torchvsa.FHRR(4000), torchvsa.HRR(4001), torchvsa.HRR(4000, torch.float64)]
spectral = pytest.mark.parametrize("vsa", SPACES, ids=repr)


def against_zero(vsa: VSA, codes: Tensor) -> Tensor:
    return vsa.similarity(codes, codes[0]).double()


# The mean of d (FHRR) or about d / 2 (HRR) independent cosines of angles, each of variance at most 1/2.
@spectral
@pytest.mark.parametrize("length", [0.05, 0.2, 1.0])
def test_gaussian_powers_have_a_gaussian_kernel(vsa: VSA, length: float) -> None:
    found = against_zero(vsa, FractionalPower(vsa, length, seed=0)(APART))
    assert_close(found, torch.exp(-((APART / length) ** 2) / 2), atol=5 / vsa.dim**0.5, rtol=0)


@spectral
@pytest.mark.parametrize("length", [0.05, 0.2, 1.0])
def test_uniform_powers_have_the_sinc_kernel(vsa: VSA, length: float) -> None:
    found = against_zero(vsa, FractionalPower(vsa, length, "sinc", seed=0)(APART))
    assert_close(found, torch.sinc(APART / length), atol=5 / vsa.dim**0.5, rtol=0)


@spectral
def test_kernels_of_powers_depend_on_the_distance_alone(vsa: VSA) -> None:
    encode = FractionalPower(vsa, seed=0)
    here, there = encode(APART[:11]), encode(APART[10:])
    assert_close(against_zero(vsa, here), against_zero(vsa, there), atol=1e-5, rtol=0)


def gaussian(apart: Tensor, length: float) -> Tensor:
    return torch.exp(-((apart / length) ** 2) / 2)


@pytest.mark.parametrize("length", [0.1, 0.3])
def test_random_fourier_features_have_a_gaussian_kernel(length: float) -> None:
    vsa = torchvsa.MAP(8000)
    # The product of two features is K + a wave of variance 1/2 + noise of the kernel itself: at most 3/2 together.
    found = against_zero(vsa, RandomFourier(vsa, 1, length, sign=False, seed=0)(APART[:, None]))
    assert_close(found, gaussian(APART, length), atol=5 * (1.5 / 8000) ** 0.5, rtol=0)


@pytest.mark.parametrize("dtype", [torch.float32, torch.int8])
@pytest.mark.parametrize("length", [0.1, 0.3])
def test_their_signs_have_the_kernel_of_signs(length: float, dtype: torch.dtype) -> None:
    vsa = torchvsa.MAP(8000, dtype=dtype)
    odd = torch.arange(1, 4001, 2, dtype=torch.float64)
    expected = 8 / math.pi**2 * (gaussian(odd * APART[:, None], length) / odd**2).sum(-1)
    found = against_zero(vsa, RandomFourier(vsa, 1, length, seed=0)(APART[:, None]))
    # The series ends at j = 4,001, with less than 2 / π² / 2,000 to come.
    assert_close(found, expected, atol=5 / 8000**0.5 + 1e-4, rtol=0)


def test_several_sensors_have_the_kernel_of_their_distance_without_those_that_are_missing() -> None:
    vsa, nan = torchvsa.MAP(8000), torch.nan
    encode = RandomFourier(vsa, 3, 0.5, sign=False, seed=0)
    x = torch.tensor([[0, 0, 0], [0.3, 0.4, 0], [0.3, nan, 0], [nan, nan, nan]], dtype=torch.float64)
    expected = gaussian(torch.tensor([0, 0.5, 0.3, 0], dtype=torch.float64), 0.5)
    assert_close(against_zero(vsa, encode(x)), expected, atol=5 * (1.5 / 8000) ** 0.5, rtol=0)
    fewer = RandomFourier(vsa, 2, 0.5, sign=False).take({"omega": encode.omega[[0, 2]], "phase": encode.phase})
    assert torch.equal(encode(x[2:3]), fewer(x[2:3, [0, 2]]))


def test_threshold_features_of_one_sensor_have_the_kernel_of_thermometers() -> None:
    vsa = torchvsa.MAP(8000)
    found = against_zero(vsa, ThresholdFeatures(vsa, 1, 1001, seed=0)(APART[:, None]))
    # One dimension in 16 is constant, give or take √(1/16 · 15/16 / d); the others flip in even steps.
    share = 5 * (15 / 16 / 16 / 8000) ** 0.5
    assert_close(found, 1 - 2 * 15 / 16 * APART, atol=2 * share + 2 / 1000, rtol=0)


# -- bins ---------------------------------------------------------------------------------------------------


def test_a_reading_of_whole_numbers_is_in_the_bin_of_its_number() -> None:
    for bins in range(1, 201):
        encode = Lookup(torchvsa.MAP(1), bins, 0)
        whole = torch.arange(bins + 1, dtype=torch.float64) / bins
        expected = [*range(bins), bins - 1]
        for x in (whole, whole.float(), (whole * bins).float() / bins):
            assert encode.cells(x).tolist() == expected


@settings(deadline=None, derandomize=True, max_examples=200)
@given(bins=st.integers(1, 200), data=st.data())
def test_bins_are_half_open_and_equally_wide(bins: int, data: st.DataObject) -> None:
    k = data.draw(st.integers(0, bins - 1))
    inside = data.draw(st.floats(1e-9, 1 - 1e-9))
    x = torch.tensor([k / bins, (k + inside) / bins], dtype=torch.float64)
    for kind in (Lookup, Circular):
        encode: Binned = kind(torchvsa.MAP(1), bins, 0)
        assert encode.cells(x).tolist() == [k, k]
    record = Product(Lookup(torchvsa.MAP(1), bins), 2, 0)
    assert record.cells(x[None]).tolist() == [[k, k]]
    assert ThresholdFeatures(torchvsa.MAP(1), 2, bins, seed=0).cells(x[None]).tolist() == [[k, k]]
