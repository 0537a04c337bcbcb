"""Records: the readings of n sensors become one hypervector, in every kind of record."""

from typing import Any, Literal

import pytest
import torch
from readings import centres, rows, seeded
from spaces import ELEMENTWISE
from torch import Tensor
from torch.testing import assert_close

import torchvsa
from torchvsa import VSA
from torchvsa.encoders import (
    Balanced,
    Circular,
    FractionalPower,
    Level,
    Lookup,
    Product,
    Record,
    SubsetProduct,
    Sum,
    Thermometer,
)

BINS = 6
RECORDS: tuple[type[Record], ...] = (Sum, Product, SubsetProduct)
VALUES = (Lookup, Level, Balanced, Thermometer, Circular)


@pytest.fixture(params=VALUES)
def values(vsa: VSA, request: pytest.FixtureRequest) -> Any:
    if request.param.negates and not vsa.negatable:
        pytest.skip("these codes negate elements")
    return request.param


@pytest.fixture(params=RECORDS)
def kind(vsa: VSA, request: pytest.FixtureRequest) -> type[Record]:
    if request.param is SubsetProduct and not vsa.elementwise:
        pytest.skip("a subset of sensors per dimension needs element-wise binding")
    return request.param


def without_the_last_sensor(encode: Record, made: Record) -> Record:
    """`made`, a plan of a record of one sensor less, with the tensors of `encode`."""
    tensors = {}
    for name, (_, shape) in made.layout().items():
        given = encode.state_dict()[name]
        tensors[name] = given if given.shape == shape else given[:-1]
    return made.take(tensors)


def test_a_sum_is_the_bundle_of_role_bound_values(vsa: VSA) -> None:
    encode = Sum(Lookup(vsa, BINS), 3, 0)
    x = rows(20, 3)
    for row, cells in zip(x, encode.cells(x).tolist(), strict=True):
        seen = [vsa.bind(encode.codes[i], encode.roles[s]) for s, i in enumerate(cells) if i >= 0]
        assert_close(encode(row[None])[0], vsa.bundle(torch.stack(seen)))


@pytest.mark.parametrize("name", ELEMENTWISE)
def test_a_product_binds_permuted_role_bound_values(name: str) -> None:
    vsa = torchvsa.architecture(name, 500)
    encode = Product(Lookup(vsa, BINS), 3, 0)
    x = rows(20, 3)
    for row, cells in zip(x, encode.cells(x).tolist(), strict=True):
        product = vsa.identity()
        for s, i in enumerate(cells):
            if i >= 0:
                product = vsa.bind(product, vsa.permute(vsa.bind(encode.roles[s], encode.codes[i]), s))
        assert_close(encode(row[None])[0], product)


def test_swapped_values_give_another_record(vsa: VSA, values: Any, kind: type[Record], chance: float) -> None:
    x = centres(torch.tensor([[0, BINS // 2], [BINS // 2, 0]]), BINS)
    encode = kind(values(vsa, BINS), 2, seed=0)
    here, there = encode(x)
    codes = encode.codes
    kernel = vsa.similarity(codes[0], codes[BINS // 2])
    # Two voters split on half the elements; the product that decides them commutes, and is the same for both.
    tied = kind is Sum and vsa.breaks_ties
    # A sum averages the kernels of both sensors, where it does not decide by majority; a product squares them.
    spare = (kernel**2 if kind is Product else abs(kernel)).item()
    assert abs(vsa.similarity(here, there) - (0.5 if tied else 0)) < chance + spare


def test_an_unobserved_sensor_is_left_out(vsa: VSA, values: Any, kind: type[Record]) -> None:
    encode, without = kind(values(vsa, BINS), 3, seed=0), kind(values(vsa, BINS), 2)
    without_the_last_sensor(encode, without)
    x = centres(torch.tensor([[3, 1], [0, 4], [-1, 2], [5, -1]]), BINS)
    missing = torch.cat([x, torch.full((4, 1), torch.nan)], 1)
    assert_close(encode(missing), without(x))


@pytest.mark.parametrize("name", ["FHRR", "HRR"])
@pytest.mark.parametrize("kind", [Sum, Product])
def test_an_unobserved_sensor_is_left_out_of_continuous_records(name: str, kind: type[Record]) -> None:
    vsa = torchvsa.architecture(name, 300)
    encode, without = kind(FractionalPower(vsa), 3, seed=0), kind(FractionalPower(vsa), 2)
    x = rows(10, 2)
    missing = torch.cat([x, torch.full((10, 1), torch.nan)], 1)
    assert_close(encode(missing), without_the_last_sensor(encode, without)(x))


def test_no_observed_sensor_is_neutral(vsa: VSA, values: Any, kind: type[Record]) -> None:
    nothing = kind(values(vsa, BINS), 3, seed=0)(torch.full((2, 3), torch.nan))
    assert torch.equal(nothing[0], nothing[1])
    x = vsa.random(generator=seeded())
    if kind is not Sum:
        assert_close(vsa.bind(x, nothing[0]), x)


@pytest.mark.parametrize("variant", ["C", "I"])
@pytest.mark.parametrize("sensors", [127, 128, 300])
def test_sums_of_many_sensors_do_not_overflow(sensors: int, variant: Literal["C", "I"]) -> None:
    vsa = torchvsa.MAP(50, variant, torch.int8)
    encode = Sum(Lookup(vsa, 2), sensors, 0)
    assert encode.table is not None
    encode.table[:, 0] = vsa.random(generator=seeded())  # all of them agree
    expected = encode.table[0, 0].int() * (1 if variant == "C" else sensors)
    for batch in (1, 5_000):
        assert (encode(torch.zeros(batch, sensors)) == expected).all()


def test_a_plan_is_drawn_by_each_record_and_a_drawn_encoder_is_shared(kind: type[Record], vsa: VSA) -> None:
    plan, shared = Level(vsa, BINS), Level(vsa, BINS, seed=4)
    first, second = kind(plan, 2, seed=0), kind(plan, 2, seed=1)
    assert not plan.drawn
    assert not torch.equal(first.codes, second.codes)
    assert kind(shared, 2, seed=0).value is kind(shared, 2, seed=1).value is shared
    assert torch.equal(shared.codes, Level(vsa, BINS, seed=4).codes)
    twice, apart = kind([plan, plan], seed=0), kind([plan, Level(vsa, BINS)], seed=0)
    assert twice.values[0] is twice.values[1]
    assert not torch.equal(*[tensor for name, tensor in apart.state_dict().items() if "codes" in name])


MIXED = torch.tensor([[0.0, 0.1, 0.1], [0.5, 0.4, 0.5], [1.0, 1.0, 0.9], [torch.nan, 0.2, torch.nan]]).double()


def test_each_sensor_may_have_a_value_encoder_of_its_own(vsa: VSA, kind: type[Record]) -> None:
    middle = Circular(vsa, 12, seed=2) if vsa.negatable else Level(vsa, 12, seed=2)
    parts = [Level(vsa, 8, seed=1), middle, Lookup(vsa, 3, seed=3)]
    encode = kind(parts, seed=0)
    assert encode.discrete
    assert encode.bins == 12
    assert encode.cells(MIXED).tolist() == [[0, 1, 0], [4, 4, 1], [7, 0 if vsa.negatable else 11, 2], [-1, 2, -1]]
    for sensor, part in enumerate(parts):
        # A sensor alone is encoded as by a record in which all sensors have its encoder.
        alone = torch.full_like(MIXED, torch.nan)
        alone[:, sensor] = MIXED[:, sensor]
        same = kind(part, 3).take(
            {name: tensor for name, tensor in encode.state_dict().items() if "values" not in name}
            | {"values.0.codes": part.codes}
        )
        assert_close(encode(alone), same(alone))
    with pytest.raises(ValueError, match="one value encoder per sensor"):
        encode.codes  # noqa: B018


@pytest.mark.parametrize("name", ["FHRR", "HRR"])
@pytest.mark.parametrize("kind", [Sum, Product])
def test_continuous_and_binned_sensors_mix(name: str, kind: type[Record]) -> None:
    vsa = torchvsa.architecture(name, 400)
    power, level, table = FractionalPower(vsa, seed=1), Level(vsa, 8, seed=2), Lookup(vsa, 3, seed=3)
    encode, binned = kind([power, level, table], seed=0), kind([level, level, table], seed=0)
    assert not encode.discrete
    assert encode.cells(MIXED)[:, 1:].tolist() == binned.cells(MIXED)[:, 1:].tolist()
    # Where the continuous sensor is missing, all is as with bins alone, in the table of role-bound values.
    missing = MIXED.clone()
    missing[:, 0] = torch.nan
    assert encode.table is None
    assert binned.table is not None
    assert_close(encode(missing), binned(missing), rtol=1e-5, atol=1e-6)
    assert not torch.equal(encode(MIXED)[:3], encode(missing)[:3])
    with pytest.raises(ValueError, match="has no bins"):
        encode.bins  # noqa: B018


# Plenty of dimensions, so that chance hides nothing: 5 / √20,000 = .035.
WIDE = torchvsa.MAP(20_000, "I")
TOLERANCE = 5 / 20_000**0.5
CELLS = torch.tensor([[0, 1, 2], [0, 3, 5]])
PAIR = centres(CELLS, BINS)
LEVEL_KERNEL = (1 - (CELLS[0] - CELLS[1]).abs() / (BINS - 1)).tolist()
LOOKUP_KERNEL = (CELLS[0] == CELLS[1]).float().tolist()


def similarity(encode: Record, pair: Tensor = PAIR) -> float:
    return encode.vsa.similarity(*encode(pair)).item()


@pytest.mark.parametrize(("values", "kernels"), [(Level, LEVEL_KERNEL), (Lookup, LOOKUP_KERNEL)])
def test_a_sum_averages_kernels_and_a_product_multiplies_them(values: Any, kernels: list[float]) -> None:
    assert similarity(Sum(values(WIDE, BINS), 3, 0)) == pytest.approx(sum(kernels) / 3, abs=TOLERANCE)
    product = kernels[0] * kernels[1] * kernels[2]
    assert similarity(Product(values(WIDE, BINS), 3, 0)) == pytest.approx(product, abs=TOLERANCE)


@pytest.mark.parametrize("name", ELEMENTWISE)
def test_a_product_multiplies_kernels_in_every_elementwise_architecture(name: str) -> None:
    found = similarity(Product(Level(torchvsa.architecture(name, 20_000), BINS), 3, 0))
    assert found == pytest.approx(LEVEL_KERNEL[1] * LEVEL_KERNEL[2], abs=TOLERANCE)


def test_a_product_multiplies_kernels_in_hrr_roughly() -> None:
    # The lengths of HRR products vary a little.
    found = similarity(Product(Level(torchvsa.HRR(20_000), BINS), 3, 0))
    assert found == pytest.approx(LEVEL_KERNEL[1] * LEVEL_KERNEL[2], abs=2 * TOLERANCE)


def test_kernels_of_different_value_encoders_are_averaged_and_multiplied() -> None:
    pair = torch.tensor([[0.05, 0.05, 0.5], [0.95, 0.3, 0.5]], dtype=torch.float64)
    # Neighbours over the end of the circle; 5 of 20 bins in thermometer codes of 19 steps; equal.
    kernels = [1 - 2 * 0.1, 1 - 2 * 5 / 19, 1.0]
    parts = [Circular(WIDE, 10), Thermometer(WIDE, 20), Lookup(WIDE, 3)]
    assert similarity(Sum(parts, seed=0), pair) == pytest.approx(sum(kernels) / 3, abs=TOLERANCE)
    assert similarity(Product(parts, seed=0), pair) == pytest.approx(kernels[0] * kernels[1], abs=TOLERANCE)


def test_continuous_kernels_are_averaged_and_multiplied() -> None:
    vsa, pair = torchvsa.FHRR(20_000), torch.tensor([[0.1, 0.3], [0.2, 0.6]], dtype=torch.float64)
    kernels = [torch.exp(torch.tensor(-((d / 0.2) ** 2) / 2)).item() for d in (0.1, 0.3)]
    product = similarity(Product(FractionalPower(vsa), 2, 0), pair)
    assert product == pytest.approx(kernels[0] * kernels[1], abs=TOLERANCE)
    # FHRR's bundle keeps angles alone, so the average is that of the sum itself.
    encode = Sum(FractionalPower(vsa), 2, 0)
    bound = torch.stack([vsa.superpose(vsa.bind(encode.roles, encode.value(x))) for x in pair])
    assert vsa.similarity(*bound).item() == pytest.approx(sum(kernels) / 2, abs=TOLERANCE)
    assert torch.equal(vsa.normalize(bound), encode(pair))


@pytest.mark.parametrize("most", [1, 2, 3])
def test_a_subset_averages_the_products_over_all_subsets(most: int) -> None:
    # A dimension draws the size of its subset, then which sensors: the mean over sizes of the mean over subsets.
    a, b, c = LEVEL_KERNEL
    by_size = {1: (a + b + c) / 3, 2: (a * b + a * c + b * c) / 3, 3: a * b * c}
    expected = sum(by_size[size] for size in range(1, most + 1)) / most
    assert similarity(SubsetProduct(Level(WIDE, BINS), 3, most, 0)) == pytest.approx(expected, abs=TOLERANCE)


def test_a_subset_holds_all_sensors_by_default() -> None:
    whole, three, more = (SubsetProduct(Level(WIDE, BINS), 3, subset, 0) for subset in (None, 3, 99))
    assert torch.equal(whole(PAIR), three(PAIR))
    assert torch.equal(whole(PAIR), more(PAIR))


def test_a_subset_of_one_ignores_a_sensor_outside_it() -> None:
    encode = SubsetProduct(Lookup(WIDE, BINS), 4, 1, 0)
    a, b = encode(centres(torch.tensor([[0, 1, 2, 3], [5, 1, 2, 3]]), BINS))
    # Only the quarter of the dimensions that holds the first sensor can change, and half of it does.
    assert (a != b).float().mean().item() == pytest.approx(1 / 8, abs=0.02)


def test_the_span_reaches_the_value_codes() -> None:
    codes = Sum(Level(WIDE, BINS, span=2), 1, 0)(centres(torch.arange(BINS)[:, None], BINS))
    assert WIDE.similarity(codes[0], codes).tolist() == pytest.approx([1, 0.5, 0, 0, 0, 0], abs=TOLERANCE)
