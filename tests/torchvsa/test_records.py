"""Records: n values become one hypervector, in every listed combination."""

from typing import Literal

import pytest
import torch
from torch import Tensor
from torch.testing import assert_close

import torchvsa
from torchvsa import VSA, Record
from torchvsa.encoding import COMBINATIONS, VALUES

LEVELS = 6
values = pytest.mark.parametrize("values", VALUES)


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def record(vsa: VSA, values: str, combine: str, sensors: int = 3) -> Record:
    return Record(vsa, sensors, LEVELS, values, combine, seeded())


@pytest.fixture(params=COMBINATIONS)
def combine(vsa: VSA, request: pytest.FixtureRequest) -> str:
    try:
        COMBINATIONS[request.param](vsa)
    except ValueError as refused:
        pytest.skip(str(refused))
    return request.param


def rows(count: int, sensors: int = 3) -> Tensor:
    """Indices, some of them unobserved, and at least one observed in every row."""
    indices = torch.randint(-1, LEVELS, (count, sensors), generator=seeded(1))
    indices[:, 0] = indices[:, 0].abs()
    return indices


def test_bundle_is_the_bundle_of_role_bound_values(vsa: VSA) -> None:
    encode = record(vsa, "lookup", "bundle")
    for row in rows(20):
        seen = [vsa.bind(encode.roles[s], encode.codes[i]) for s, i in enumerate(row.tolist()) if i >= 0]
        assert_close(encode(row[None])[0], vsa.bundle(torch.stack(seen)))


@pytest.mark.parametrize("name", [n for n in torchvsa.ARCHITECTURES if torchvsa.architecture(n, 1).elementwise])
def test_bind_is_the_product_of_permuted_role_bound_values(name: str) -> None:
    vsa = torchvsa.architecture(name, 500)
    encode = record(vsa, "lookup", "bind")
    for row in rows(20):
        product = vsa.identity()
        for s, i in enumerate(row.tolist()):
            if i >= 0:
                product = vsa.bind(product, vsa.permute(vsa.bind(encode.roles[s], encode.codes[i]), s))
        assert_close(encode(row[None])[0], product)


@values
def test_the_same_generator_gives_the_same_record(vsa: VSA, values: str, combine: str) -> None:
    assert torch.equal(record(vsa, values, combine)(rows(5)), record(vsa, values, combine)(rows(5)))


@values
def test_swapped_values_give_another_record(vsa: VSA, values: str, combine: str, chance: float) -> None:
    encode = record(vsa, values, combine, sensors=2)
    here, there = encode(torch.tensor([[0, 5], [5, 0]]))
    # Two voters split on half the elements; the product that decides them commutes, and is the same for both.
    tied = combine == "bundle" and vsa.name in ("MAP-B", "BSC")
    # Different balanced codes are less alike than by chance, each pair of 6 by 1/5.
    spare = 0.2 if values == "balanced" else 0
    assert abs(vsa.similarity(here, there) - (0.5 if tied else 0)) < chance + spare


@values
def test_the_batch_does_not_change_a_record(vsa: VSA, values: str, combine: str) -> None:
    encode = record(vsa, values, combine)
    indices = rows(30)
    whole = encode(indices)
    for size in (1, 7):
        parts = torch.cat([encode(part) for part in indices.split(size)])
        if vsa.elementwise:
            assert torch.equal(parts, whole)
        else:
            assert_close(parts, whole, rtol=1e-5, atol=1e-6)
    assert encode(indices[:0]).shape == (0, vsa.dim)


@pytest.mark.parametrize("variant", ["C", "I"])
@pytest.mark.parametrize("sensors", [127, 128, 300])
def test_sums_of_many_sensors_do_not_overflow(sensors: int, variant: Literal["C", "I"]) -> None:
    vsa = torchvsa.MAP(50, variant, torch.int8)
    encode = Record(vsa, sensors, 2, generator=seeded())
    encode.table[:, 0] = vsa.random(generator=seeded())  # all of them agree
    expected = encode.table[0, 0].int() * (1 if variant == "C" else sensors)
    for batch in (1, 50_000):
        assert (encode(torch.zeros(batch, sensors, dtype=torch.int64)) == expected).all()


@values
def test_an_unobserved_sensor_is_left_out(vsa: VSA, values: str, combine: str) -> None:
    encode = record(vsa, values, combine)
    without = record(vsa, values, combine, sensors=2)
    for name, table in encode.named_buffers():
        if name in ("roles", "table"):
            setattr(without, name, table[:2])
    indices = torch.tensor([[3, 1], [0, 4], [-1, 2], [5, -1]])
    missing = torch.cat([indices, torch.full((4, 1), -1)], 1)
    assert_close(encode(missing), without(indices))


@values
def test_no_observed_sensor_gives_the_same_neutral_record_always(vsa: VSA, values: str, combine: str) -> None:
    encode = record(vsa, values, combine)
    nothing = encode(torch.full((2, 3), -1))
    assert torch.equal(nothing[0], nothing[1])
    x = vsa.random(generator=seeded())
    if combine != "bundle":
        assert_close(vsa.bind(nothing[0], x), x)


# Plenty of dimensions, so that chance hides nothing: 5 / √20,000 = .035.
WIDE = torchvsa.MAP(20_000, "I")
TOLERANCE = 5 / 20_000**0.5
A, B = torch.tensor([[0, 1, 2]]), torch.tensor([[0, 3, 5]])
LEVEL_KERNEL = (1 - (A - B).abs() / (LEVELS - 1)).flatten()


def similarity(combine: str, values: str, a: Tensor, b: Tensor, **options: int) -> float:
    encode = Record(WIDE, a.shape[1], LEVELS, values, combine, seeded(), **options)
    return WIDE.similarity(encode(a), encode(b)).item()


@pytest.mark.parametrize(("values", "kernels"), [("level", LEVEL_KERNEL), ("lookup", (A == B).flatten().float())])
def test_a_bundle_averages_kernels(values: str, kernels: Tensor) -> None:
    assert similarity("bundle", values, A, B) == pytest.approx(kernels.mean().item(), abs=TOLERANCE)


@pytest.mark.parametrize(("values", "kernels"), [("level", LEVEL_KERNEL), ("lookup", (A == B).flatten().float())])
def test_binding_multiplies_kernels(values: str, kernels: Tensor) -> None:
    assert similarity("bind", values, A, B) == pytest.approx(kernels.prod().item(), abs=TOLERANCE)


@pytest.mark.parametrize("name", [n for n in torchvsa.ARCHITECTURES if torchvsa.architecture(n, 1).elementwise])
def test_binding_multiplies_kernels_in_every_elementwise_architecture(name: str) -> None:
    vsa = torchvsa.architecture(name, 20_000)
    encode = Record(vsa, 3, LEVELS, "level", "bind", seeded())
    found = vsa.similarity(encode(A), encode(B)).item()
    assert found == pytest.approx(LEVEL_KERNEL.prod().item(), abs=TOLERANCE)


def test_binding_multiplies_kernels_in_hrr_roughly() -> None:
    vsa = torchvsa.HRR(20_000)
    encode = Record(vsa, 3, LEVELS, "level", "bind", seeded())
    found = vsa.similarity(encode(A), encode(B)).item()
    # The lengths of HRR products vary a little.
    assert found == pytest.approx(LEVEL_KERNEL.prod().item(), abs=2 * TOLERANCE)


@pytest.mark.parametrize("most", [1, 2, 3])
def test_a_subset_averages_the_products_over_all_subsets(most: int) -> None:
    # A dimension draws the size of its subset, then which sensors: the mean over sizes of the mean over subsets.
    kernels = LEVEL_KERNEL.tolist()
    by_size = {
        1: sum(kernels) / 3,
        2: (kernels[0] * kernels[1] + kernels[0] * kernels[2] + kernels[1] * kernels[2]) / 3,
        3: kernels[0] * kernels[1] * kernels[2],
    }
    expected = sum(by_size[size] for size in range(1, most + 1)) / most
    assert similarity("subset", "level", A, B, subset=most) == pytest.approx(expected, abs=TOLERANCE)


def test_a_subset_holds_all_sensors_by_default() -> None:
    assert similarity("subset", "level", A, B) == similarity("subset", "level", A, B, subset=3)
    assert similarity("subset", "level", A, B) == similarity("subset", "level", A, B, subset=99)


def test_a_subset_of_one_ignores_a_sensor_outside_it() -> None:
    encode = Record(WIDE, 4, LEVELS, "lookup", "subset", seeded(), subset=1)
    a = encode(torch.tensor([[0, 1, 2, 3]]))
    b = encode(torch.tensor([[5, 1, 2, 3]]))
    # Only the quarter of the dimensions that holds the first sensor can change, and half of it does.
    assert (a != b).float().mean().item() == pytest.approx(1 / 8, abs=0.02)


def test_the_span_reaches_the_value_codes() -> None:
    encode = Record(WIDE, 1, LEVELS, "level", "bundle", seeded(), span=2)
    codes = encode(torch.arange(LEVELS)[:, None])
    assert WIDE.similarity(codes[0], codes).tolist() == pytest.approx([1, 0.5, 0, 0, 0, 0], abs=TOLERANCE)
