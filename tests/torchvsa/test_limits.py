"""Arguments beyond their limits: one line that names the limit, before anything is computed or allocated."""

import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
import torch

import torchvsa
from torchvsa import BSC, FHRR, HRR, MAP, VSA, FixedShift, SelfShift, ShapeError
from torchvsa.encoders import (
    Balanced,
    Circular,
    FractionalPower,
    Level,
    Lookup,
    ObliqueFeatures,
    Product,
    RandomFourier,
    SubsetProduct,
    Sum,
    Thermometer,
    ThresholdFeatures,
)


@pytest.mark.parametrize("make", [lambda d: MAP(d), HRR, FHRR, BSC, lambda d: torchvsa.architecture("MAP-B", d)])
def test_a_dimension_is_any_whole_number(make: Callable[[object], VSA]) -> None:
    for dim in (300, np.int64(300), np.uint16(300), torch.tensor(300)):
        vsa = make(dim)
        assert type(vsa.dim) is int
        assert vsa == make(300)
        assert vsa.random(2).shape == (2, 300)
    for dim in (True, np.bool_(True), 300.0, "300", None, 0, -1):
        with pytest.raises(ValueError, match="dim is the number of elements of a hypervector, a positive integer; got"):
            make(dim)


def test_an_option_does_not_contradict_the_name() -> None:
    with pytest.raises(ValueError, match="MAP-C has the variant 'C'; got variant='B'"):
        torchvsa.architecture("MAP-C", 8, variant="B")
    assert torchvsa.architecture("MAP-C", 8, variant="C") == MAP(8)
    assert torchvsa.architecture("MAP-C", 8, atoms="uniform") == MAP(8, atoms="uniform")


@pytest.mark.parametrize("shift", ["x", 2.5, None, True])
def test_a_fixed_shift_is_a_whole_number(shift: int) -> None:
    with pytest.raises(ValueError, match="the shift of a fixed shift is a whole number; got"):
        FixedShift(MAP(8), shift)


def test_a_fixed_shift_of_numpy_is_kept_as_an_int() -> None:
    protect = FixedShift(MAP(8), np.int64(-3))  # pyright: ignore[reportArgumentType]
    assert protect.config() == {"name": "fixed_shift", "shift": -3}
    assert type(protect.shift) is int


def test_the_name_of_a_self_shift_is_a_hypervector_of_its_space() -> None:
    for h in (torch.ones(7), torch.ones(1, 8), torch.tensor(1.0)):
        with pytest.raises(ShapeError, match="h must be one hypervector of d = 8 elements"):
            SelfShift(MAP(8), h=h)
    for vsa, h in (
        (MAP(8), torch.ones(8).double()),
        (MAP(8, dtype=torch.int8), torch.ones(8)),
        (BSC(8), torch.ones(8)),
    ):
        with pytest.raises(ValueError, match="h must be a hypervector of"):
            SelfShift(vsa, h=h)


HUGE = 10**14
BINNED = (Lookup, Level, Balanced, Thermometer, Circular)
RECORDS = (Sum, Product, SubsetProduct)
TOO_LARGE: dict[str, Callable[[], object]] = {
    **{name: lambda name=name: torchvsa.architecture(name, HUGE).random() for name in torchvsa.ARCHITECTURES},
    "uniform atoms": lambda: MAP(HUGE, atoms="uniform").random(),
    "many vectors": lambda: MAP(1000).random(10**6, 10**6),
    "an identity": lambda: MAP(HUGE).identity(),
    "a self-derived shift": lambda: SelfShift(MAP(HUGE), seed=0),
    "its columns": lambda: SelfShift(MAP(HUGE), h=torch.ones(1).expand(HUGE)),
    **{f"{kind.name} codes": lambda kind=kind: kind(MAP(1000), HUGE, seed=0) for kind in BINNED},
    **{f"{kind.name} of many bins": lambda kind=kind: kind(Lookup(MAP(1000), HUGE), 2, seed=0) for kind in RECORDS},
    **{f"{kind.name} of many sensors": lambda kind=kind: kind(Lookup(MAP(1000), 2), HUGE, seed=0) for kind in RECORDS},
    "thresholds of many sensors": lambda: ThresholdFeatures(MAP(1000), HUGE, 2, seed=0),
    "thresholds of many dimensions": lambda: ThresholdFeatures(MAP(HUGE), 2, 2, seed=0),
    "angles of many dimensions": lambda: FractionalPower(FHRR(HUGE), seed=0),
    "weighted sums of many sensors": lambda: ObliqueFeatures(MAP(1000), HUGE, seed=0),
    "random features of many sensors": lambda: RandomFourier(MAP(1000), HUGE, seed=0),
}


@pytest.mark.parametrize("name", TOO_LARGE)
def test_what_exceeds_memory_is_refused_before_it_is_taken(name: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r" needs .*TB of memory, of which .* are available; ") as refused:
            TOO_LARGE[name]()
        assert tracemalloc.get_traced_memory()[1] < 2**22
    finally:
        tracemalloc.stop()
    assert "\n" not in str(refused.value)


def test_what_fits_is_not_refused() -> None:
    assert MAP(2**20, dtype=torch.int8).random(100).shape == (100, 2**20)
    assert ThresholdFeatures(MAP(100), 3, 10**12, seed=0).threshold.max() < 10**12
