"""Shifts, sums and products of integers: what NumPy's wide integers give, or an error that names the limit."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

import torchvsa
from torchvsa import BSC, MAP, ShapeError

bounded = settings(deadline=None, derandomize=True, max_examples=60)
NARROW = [torch.uint8, torch.int8, torch.int16, torch.int32, torch.int64]
CODES = MAP(4, "I", torch.int8)


@bounded
@given(data=st.data(), dtype=st.sampled_from(NARROW), d=st.sampled_from([1, 2, 100, 256, 300, 4000, 70_000]))
def test_shifts_of_any_integer_type_are_those_of_numpy(data: st.DataObject, dtype: torch.dtype, d: int) -> None:
    info = torch.iinfo(dtype)
    shifts = [*data.draw(st.lists(st.integers(info.min, info.max), max_size=3)), info.min, info.max]
    x = np.random.default_rng(0).normal(size=(len(shifts), d)).astype(np.float32)
    rotated = MAP(d).permute(torch.from_numpy(x), torch.tensor(shifts, dtype=dtype))
    assert (rotated.numpy() == np.stack([np.roll(row, s % d) for row, s in zip(x, shifts, strict=True)])).all()


@pytest.mark.parametrize("shift", [3, -3, 2**63, -(2**80), np.int64(-3), np.uint8(200), torch.tensor(7)])
def test_a_shift_is_any_whole_number(shift: int) -> None:
    x = np.arange(50.0, dtype=np.float32)
    assert (MAP(50).permute(torch.from_numpy(x), shift).numpy() == np.roll(x, int(shift) % 50)).all()


@pytest.mark.parametrize("shift", [1.0, True, "1", torch.tensor(1.0), torch.tensor(True), torch.tensor(1j)])
def test_other_shifts_are_refused(shift: int) -> None:
    with pytest.raises(ValueError, match="shifts are a whole number or a tensor of integers; got"):
        MAP(50).permute(torch.ones(50), shift)


@bounded
@given(data=st.data(), votes=st.sampled_from(NARROW), kind=st.sampled_from([None, torch.bool, *NARROW]))
def test_integer_sums_are_exact_or_refused(data: st.DataObject, votes: torch.dtype, kind: torch.dtype | None) -> None:
    def numbers(dtype: torch.dtype, count: int) -> list[int]:
        low, high = (0, 1) if dtype == torch.bool else (torch.iinfo(dtype).min, torch.iinfo(dtype).max)
        small = st.integers(max(low, -3), min(high, 3))
        return data.draw(st.lists(small | st.integers(low, high), min_size=count, max_size=count))

    count = data.draw(st.integers(1, 5))
    xs, given_weights = numbers(votes, count), [1] * count if kind is None else numbers(kind, count)
    exact = sum(x * w for x, w in zip(xs, given_weights, strict=True))
    summands = torch.tensor(xs, dtype=votes)[:, None].expand(count, 4)
    weights = None if kind is None else torch.tensor(given_weights, dtype=kind)
    most = count * max(abs(x) for x in xs) * max(abs(w) for w in given_weights)
    if abs(exact) < 2**31 and most < 2**63:
        total = CODES.superpose(summands, weights=weights)
        assert total.dtype == torch.int32
        assert total.tolist() == [exact] * 4
    else:
        with pytest.raises(ValueError, match=r"the sum .*beyond (the limit of int32, 2,147,483,647|int64)"):
            CODES.superpose(summands, weights=weights)


@pytest.mark.parametrize("weight", [2**28, 2**31, 2**32, 3_000_000_000])
def test_a_weight_that_overflows_a_program_is_refused(weight: int) -> None:
    programs = torch.tensor([[8, -8, 0, 8], [1, 1, 1, 1]], dtype=torch.int32)
    with pytest.raises(ValueError, match=r"2,147,483,647"):
        CODES.superpose(programs, weights=torch.tensor([weight, 0]))


def test_weights_in_half_precision_are_summed_in_single() -> None:
    votes = torch.ones(5, 4, dtype=torch.int8)
    for dtype, weight in ((torch.float16, 60_000.0), (torch.bfloat16, 257.0)):
        weights = torch.full((5,), weight, dtype=dtype)
        total = CODES.superpose(votes, weights=weights)
        assert total.dtype == torch.float32
        assert total.tolist() == [5 * weights[0].item()] * 4


@pytest.mark.parametrize("vsa", [CODES, MAP(4), BSC(4)], ids=repr)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_weights_that_are_no_numbers_are_refused(vsa: torchvsa.VSA, bad: float) -> None:
    with pytest.raises(ValueError, match="weights must be finite"):
        vsa.bundle(vsa.random(2), weights=torch.tensor([bad, 1]))


def test_weights_beyond_the_type_of_floats_are_refused() -> None:
    with pytest.raises(ValueError, match=r"weights must be finite in the summands' type, torch.float32"):
        MAP(4).superpose(torch.ones(1, 4), weights=torch.tensor([1e300], dtype=torch.float64))
    with pytest.raises(ValueError, match=r"weights must be real .* got torch.complex64"):
        MAP(4).superpose(torch.ones(1, 4), weights=torch.tensor([1j]))


@bounded
@given(st.lists(st.integers(-(2**31), 2**31 - 1), min_size=4, max_size=4), st.sampled_from([1, 3, 46_340, 46_341]))
def test_products_of_accumulators_are_exact_or_refused(numbers: list[int], other: int) -> None:
    raw, factor = torch.tensor(numbers, dtype=torch.int32), torch.full((4,), other, dtype=torch.int32)
    exact = [number * other for number in numbers]
    for bind in (CODES.bind, CODES.unbind, BSC(4).bind, BSC(4).unbind):
        if max(map(abs, exact)) < 2**31:
            assert bind(raw, factor).tolist() == exact
        else:
            with pytest.raises(ValueError, match=r"the product reaches .* limit of int32, 2,147,483,647"):
                bind(raw, factor)


def test_two_accumulators_are_bundled_exactly_or_refused() -> None:
    most = torch.full((4,), 2**31 - 1, dtype=torch.int32)
    for variant in ("C", "B", "I"):
        with pytest.raises(ValueError, match="limit of int32"):
            MAP(4, variant, torch.int8)._bundle_pair(most, most)
    clipping = MAP(4, dtype=torch.int8)
    assert clipping._bundle_pair(most, -most).tolist() == [0] * 4
    assert clipping._bundle_pair(most - 1, torch.ones(4, dtype=torch.int8)).tolist() == [1] * 4


def test_accumulators_in_int64_are_narrowed_or_refused() -> None:
    assert CODES.normalize(torch.tensor([5, -5, 0, 2**31 - 1])).tolist() == [5, -5, 0, 2**31 - 1]
    with pytest.raises(ValueError, match="limit of int32"):
        CODES.normalize(torch.tensor([0, 0, 0, 2**31]))


def test_the_majority_of_raw_votes_is_that_of_their_signs() -> None:
    votes = torch.tensor([[300, 300, -300, -300], [-300, 300, 300, -300]], dtype=torch.int32)
    # The product of the two, shifted by one, decides where they sum to 0.
    assert MAP(4, "B", torch.int8).bundle(votes).tolist() == [1, 1, 1, -1]
    assert BSC(4).bundle(votes).tolist() == [False, False, False, True]


@pytest.mark.parametrize("vsa", [MAP(4, "C", torch.int8), MAP(4, "B", torch.int8), MAP(4, "B"), BSC(4)], ids=repr)
def test_no_code_is_made_of_nan(vsa: torchvsa.VSA) -> None:
    with pytest.raises(ValueError, match="NaN"):
        vsa.normalize(torch.tensor([math.nan, 1, 2, 3]))


def test_lists_of_hypervectors_are_bundled(vsa: torchvsa.VSA, draw: Callable[..., Tensor]) -> None:
    a, b, c = draw(3, 5)
    expected = vsa.bundle(torch.stack([a, b, c], -2))
    for xs in ([a, b, c], (a, b, c)):
        assert torch.equal(vsa.bundle(xs), expected)
        assert torch.equal(vsa.superpose(xs), vsa.superpose(torch.stack([a, b, c], -2)))
    weights = torch.tensor([2, 0, 1])
    assert torch.equal(vsa.bundle([a, b, c], weights=weights), vsa.bundle(torch.stack([a, b, c], -2), weights=weights))


def test_a_space_of_floats_sums_integers_as_floats() -> None:
    numbers = torch.full((3, 4), 2**31 - 1, dtype=torch.int32)
    assert MAP(4).superpose(numbers).dtype == torch.float32
    assert (
        MAP(4, dtype=torch.float64).superpose(numbers, weights=torch.tensor([1, 2, 3])).tolist()
        == [6.0 * (2**31 - 1)] * 4
    )


def test_bits_and_votes_in_one_list_count_as_votes() -> None:
    bits, votes = torch.tensor([False, True, False, True]), torch.tensor([-5, 5, 5, -5], dtype=torch.int32)
    assert BSC(4).superpose([bits, votes]).tolist() == [-4, 4, 6, -6]
    assert BSC(4)._bundle_pair(votes, bits).tolist() == [True, False, False, True]


def test_what_cannot_be_bundled_is_named_in_one_line() -> None:
    x = torch.ones(4)
    calls: dict[str, Callable[[], object]] = {
        r"a tensor was given; to bundle a and b write \[a, b\]": lambda: MAP(4).bundle(x, x),  # pyright: ignore[reportArgumentType]
        "at least one tensor": lambda: MAP(4).bundle([]),
        "a list of tensors": lambda: MAP(4).bundle("x"),  # pyright: ignore[reportArgumentType]
        r"shapes that broadcast; got \(4,\), \(3,\)": lambda: MAP(4).bundle([x, x[:3]]),
        "d = 4": lambda: MAP(4).superpose([x[:3]]),
    }
    for message, call in calls.items():
        with pytest.raises(ValueError, match=message) as refused:
            call()
        assert "\n" not in str(refused.value)
    with pytest.raises(ShapeError):
        MAP(4).bundle([x, x[:3]])
    with pytest.raises(ValueError, match="a tensor was given"):
        BSC(4).bundle(x.bool(), x.bool())  # pyright: ignore[reportArgumentType]


def test_graphs_and_maps_sum_without_looking() -> None:
    votes, weights = torch.ones(3, 2, 4, dtype=torch.int32), torch.tensor([2, 5])
    graph = torch.compile(lambda xs, w: CODES.superpose(xs, weights=w), fullgraph=True, backend="aot_eager")
    expected = torch.full((3, 4), 7, dtype=torch.int32)
    assert torch.equal(graph(votes, weights), expected)
    assert torch.equal(torch.vmap(lambda xs: CODES.superpose(xs, weights=weights))(votes), expected)
    assert torch.equal(torch.vmap(CODES.bind)(votes, votes), votes)
    torch.compiler.reset()
