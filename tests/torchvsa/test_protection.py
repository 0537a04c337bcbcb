"""Protection: exact widths, the shift itself, and its inverse."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from readings import centres
from torch import Tensor
from torch.testing import assert_close

import torchvsa
from torchvsa import PROTECTIONS, VSA, FixedShift, Protection, SelfShift, protection
from torchvsa.encoders import Lookup, Sum

bounded = settings(deadline=None, derandomize=True, max_examples=40)
Draw = Callable[..., Tensor]
WIDTHS = ("mean", "sum")


def true_width(positive: np.ndarray, rule: str) -> int:
    """The width by Python's own integers: the rounded mean, or the sum mod d, of the positive indices."""
    indices = [int(i) for i in np.flatnonzero(positive)]
    if rule == "sum":
        return sum(indices) % len(positive)
    return (2 * sum(indices) + len(indices)) // (2 * len(indices)) if indices else 0


def width(vsa: VSA, x: Tensor, rule: str) -> Tensor:
    return SelfShift(vsa, rule, seed=0).width(x)  # pyright: ignore[reportArgumentType]


@bounded
@given(x=hnp.arrays(np.int8, st.integers(1, 300), elements=st.integers(-1, 1)))
def test_the_width_is_exact_for_any_dimension(x: np.ndarray) -> None:
    for rule in WIDTHS:
        for values in (torch.from_numpy(x), torch.from_numpy(x).float()):
            vsa = torchvsa.MAP(len(x), dtype=values.dtype)
            assert width(vsa, values, rule).item() == true_width(x > 0, rule)


# From d = 128² + 1 on, indices have three digits in base 128; a float32 mean is wrong far below 50,001.
@pytest.mark.parametrize("dim", [127, 128, 129, 4001, 16_384, 16_385, 50_001])
@pytest.mark.parametrize("dtype", [torch.int8, torch.float32, torch.float64])
def test_the_width_is_exact_in_large_dimensions(dim: int, dtype: torch.dtype) -> None:
    vsa = torchvsa.MAP(dim, dtype=dtype)
    x = torch.cat([vsa.random(5, generator=torch.Generator().manual_seed(dim)), torch.ones(1, dim).to(dtype)])
    for rule in WIDTHS:
        expected = [true_width(row > 0, rule) for row in x.numpy()]
        assert width(vsa, x, rule).tolist() == expected


def test_the_mean_is_rounded_half_up() -> None:
    x = torch.zeros(2, 6)
    x[0, [0, 1]] = 1
    x[1, [2, 3, 3, 5]] = 1
    assert width(torchvsa.MAP(6), x, "mean").tolist() == [1, 3]


@pytest.mark.parametrize("rule", WIDTHS)
def test_nothing_above_zero_gives_width_zero(vsa: VSA, rule: str) -> None:
    nothing = torch.ones(2, vsa.dim) > 0 if vsa.dtype == torch.bool else -torch.ones(2, vsa.dim).to(vsa.dtype)
    assert width(vsa, nothing, rule).tolist() == [0, 0]


@pytest.mark.parametrize("rule", WIDTHS)
def test_widths_take_the_elements_that_each_architecture_calls_positive(vsa: VSA, draw: Draw, rule: str) -> None:
    x = draw(3, 2)
    positive = ~x if x.dtype == torch.bool else (x.real if x.is_complex() else x) > 0
    expected = [[true_width(row, rule) for row in rows] for rows in positive.numpy()]
    assert width(vsa, x, rule).tolist() == expected


@pytest.mark.parametrize("rule", WIDTHS)
def test_protect_is_the_shifted_bundle_with_h(vsa: VSA, draw: Draw, rule: str) -> None:
    protect = SelfShift(vsa, rule, seed=3)  # pyright: ignore[reportArgumentType]
    x = draw(2, 3)
    for row, protected in zip(x.flatten(0, 1), protect(x).flatten(0, 1), strict=True):
        superposed = vsa.bundle(torch.stack([row, protect.h])).numpy()
        assert_close(protected.numpy(), np.roll(superposed, int(protect.width(row))))


@bounded
@given(data=st.data(), rule=st.sampled_from(WIDTHS))
def test_protect_is_the_paper_read_literally(data: st.DataObject, rule: str) -> None:
    dim = data.draw(st.integers(1, 200))
    x = data.draw(hnp.arrays(np.int8, dim, elements=st.integers(-1, 1)))
    h = data.draw(hnp.arrays(np.int8, dim, elements=st.sampled_from([-1, 1])))
    w = true_width(x > 0, rule)
    name_of_w = np.roll(h, w)
    expected = np.clip(np.roll(x, w) + name_of_w, -1, 1)
    vsa = torchvsa.MAP(dim, dtype=torch.int8)
    protect = SelfShift(vsa, rule, h=torch.from_numpy(h))  # pyright: ignore[reportArgumentType]
    assert (protect(torch.from_numpy(x)).numpy() == expected).all()


@pytest.mark.parametrize("rule", WIDTHS)
@pytest.mark.parametrize("name", ["MAP-C", "MAP-I"])
@pytest.mark.parametrize("dtype", [torch.int8, torch.float32])
def test_a_bipolar_vector_comes_back_exactly(name: str, dtype: torch.dtype, rule: str) -> None:
    vsa = torchvsa.architecture(name, 1001, dtype)
    protect = SelfShift(vsa, rule, seed=1)  # pyright: ignore[reportArgumentType]

    @bounded
    @given(x=hnp.arrays(np.int8, (2, 1001), elements=st.sampled_from([-1, 1])), seed=st.integers(0, 2**32))
    def comes_back(x: np.ndarray, seed: int) -> None:
        drawn = vsa.random(2, generator=torch.Generator().manual_seed(seed))
        for bipolar in (torch.from_numpy(x).to(dtype), drawn):
            assert torch.equal(protect.invert(protect(bipolar)), bipolar.to(protect(bipolar).dtype))
            assert torch.equal(protect.decode(protect(bipolar)), protect.width(bipolar))

    comes_back()


# How much of x each estimate keeps: a majority of two is right for 3 of 4 elements, the others (almost) wholly.
KEPT = {"MAP-B": 0.5, "BSC": 0.5}


@pytest.mark.parametrize("rule", WIDTHS)
def test_an_estimate_resembles_what_was_protected(vsa: VSA, draw: Draw, chance: float, rule: str) -> None:
    protect = SelfShift(vsa, rule, seed=1)  # pyright: ignore[reportArgumentType]
    x = draw(20)
    similarity = vsa.similarity(protect.invert(protect(x)), x)
    assert similarity.min() > KEPT.get(vsa.name, 1 - chance) - chance
    assert torch.equal(protect.decode(protect(x)), protect.width(x))


def test_an_estimate_of_a_clipped_record_resembles_it() -> None:
    vsa = torchvsa.MAP(4000)
    protect = SelfShift(vsa, seed=0)
    records = vsa.bundle(vsa.random(20, 4, generator=torch.Generator().manual_seed(1)))
    # Zeros come back as h, and where x and h agree nothing is lost: the rest of x is exact.
    similarity = vsa.similarity(protect.invert(protect(records)), records)
    assert similarity.min() > (5 / 8) ** 0.5 - 5 / 4000**0.5


def conditions(count: int, clipped: bool = True) -> tuple[VSA, Tensor]:
    """Records of three sensors in which neighbours differ in one sensor only."""
    vsa = torchvsa.MAP(4000)
    bound = vsa.random(count + 2, generator=torch.Generator().manual_seed(0))
    fillers = torch.cat([bound[:2].expand(count, 2, 4000), bound[2:, None]], 1)
    return vsa, vsa.bundle(fillers) if clipped else vsa.superpose(fillers)


def neighbours(vsa: VSA, x: Tensor) -> float:
    return vsa.similarity(x[:-1], x[1:]).mean().item()


def test_the_self_derived_shift_is_a_hash() -> None:
    vsa, clipped = conditions(200)
    # The two fillers in common agree in half of their elements, give or take 1/√d: they are the same in every row.
    assert neighbours(vsa, clipped) == pytest.approx(0.50, abs=0.03)
    assert neighbours(vsa, conditions(200, clipped=False)[1]) == pytest.approx(0.66, abs=0.03)
    for rule in WIDTHS:
        assert abs(neighbours(vsa, SelfShift(vsa, rule, seed=0)(clipped))) < 0.03


def test_means_collide_and_sums_do_not() -> None:
    vsa = torchvsa.MAP(4000)
    pairs = torch.triu_indices(400, 400, 1)
    found: dict[str, list[tuple[float, float]]] = {rule: [] for rule in WIDTHS}
    for seed in range(5):
        encode = Sum(Lookup(vsa, bins=8), sensors=3, seed=seed)
        chosen = torch.randperm(8**3, generator=torch.Generator().manual_seed(seed))[:400]
        x = encode(centres(torch.cartesian_prod(*[torch.arange(8)] * 3)[chosen], 8))
        for rule in WIDTHS:
            widths = SelfShift(vsa, rule, seed=0).width(x)
            shared = (widths[pairs[0]] == widths[pairs[1]]).double().mean().item()
            found[rule].append((len(widths.unique()), shared))
    (means, mean_pairs), (sums, sum_pairs) = ([*np.mean(found[rule], 0)] for rule in WIDTHS)
    # Widths are about normal with σ = √(d/12) = 18: two are equal with chance 1/(2σ√π) = .0155, up to .02 in one draw.
    assert means == pytest.approx(75, abs=8)
    assert mean_pairs == pytest.approx(0.017, abs=0.002)
    # Over d equal chances: 1/4,000 of the pairs.
    assert sums > 360
    assert sum_pairs < 0.0005


def test_conditions_that_share_a_width_share_its_name() -> None:
    vsa = torchvsa.MAP(4000)
    x = vsa.bundle(vsa.random(100, 3, generator=torch.Generator().manual_seed(0)))
    protect = SelfShift(vsa, seed=0)
    first, second = torch.triu_indices(100, 100, 1)
    same = protect.width(x)[first] == protect.width(x)[second]
    y = protect(x)
    assert vsa.similarity(y[first[same]], y[second[same]]).mean().item() == pytest.approx(0.52, abs=0.03)
    assert vsa.similarity(y[first[~same]], y[second[~same]]).mean().item() == pytest.approx(0, abs=0.005)


@pytest.mark.parametrize("name", sorted(set(PROTECTIONS) - {"self_shift"}))
def test_other_protections_keep_similarity_and_invert_exactly(vsa: VSA, draw: Draw, name: str) -> None:
    protect = PROTECTIONS[name](vsa)
    x = torch.cat([draw(3), vsa.bundle(draw(2, 3))])
    y = protect(x)
    assert torch.equal(protect.invert(y), x)
    assert torch.equal(protect(protect.invert(x)), x)
    assert_close(vsa.similarity(y[:, None], y), vsa.similarity(x[:, None], x))


def test_a_fixed_shift_shifts_to_the_right() -> None:
    protect = FixedShift(torchvsa.MAP(5), shift=2)
    assert protect(torch.arange(5)).tolist() == [3, 4, 0, 1, 2]


def drawn(name: str, vsa: VSA) -> Protection:
    return PROTECTIONS.find(name)(vsa).draw(torch.Generator().manual_seed(0))


@pytest.mark.parametrize("name", PROTECTIONS)
def test_an_empty_batch_gives_an_empty_batch(vsa: VSA, draw: Draw, name: str) -> None:
    protect = drawn(name, vsa)
    assert protect(draw(0)).shape == protect.invert(draw(0)).shape == (0, vsa.dim)


@pytest.mark.parametrize("name", PROTECTIONS)
def test_a_batch_is_its_singles(vsa: VSA, draw: Draw, name: str) -> None:
    protect = drawn(name, vsa)
    x = draw(4, 2)
    assert torch.equal(protect(x), torch.stack([torch.stack([protect(one) for one in pair]) for pair in x]))


@pytest.mark.parametrize("name", PROTECTIONS)
def test_a_protection_is_made_again_from_its_config(vsa: VSA, draw: Draw, name: str) -> None:
    first = drawn(name, vsa)
    again = protection(first.config(), vsa)
    assert again.layout() == first.layout()
    again.take(first.state_dict())
    assert torch.equal(again(draw(3)), first(draw(3)))
    assert again.config() == first.config()


def test_the_seed_decides_h() -> None:
    vsa = torchvsa.MAP(100)
    assert torch.equal(SelfShift(vsa, seed=5).h, SelfShift(vsa, seed=5).h)
    assert not torch.equal(SelfShift(vsa, seed=5).h, SelfShift(vsa, seed=6).h)


def test_a_plan_has_no_name_of_its_widths_yet() -> None:
    plan = SelfShift(torchvsa.MAP(100))
    assert not plan.drawn
    with pytest.raises(ValueError, match=r"'self_shift' part has no codebooks yet; make it with a seed, or call draw"):
        plan(torch.ones(100))
    assert torch.equal(plan.draw(torch.Generator().manual_seed(5)).h, SelfShift(torchvsa.MAP(100), seed=5).h)
