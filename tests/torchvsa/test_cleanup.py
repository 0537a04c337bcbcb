"""Clean-up memory against a NumPy transcription in float64."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from torch import Tensor
from torch.testing import assert_close

import torchvsa
from torchvsa import VSA, CleanUp, Match
from torchvsa._numerics import as_bipolar

bounded = settings(deadline=None, derandomize=True, max_examples=80)


def oracle(queries: np.ndarray, items: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Index, similarity and margin of the best cosine; the first of equals; a zero vector has cosine 0."""

    def over(x: np.ndarray, length: np.ndarray) -> np.ndarray:
        return np.where(length > 0, x / np.where(length > 0, length, 1), 0)

    def length(x: np.ndarray) -> np.ndarray:
        return np.sqrt(np.real(x * x.conj()).sum(-1))

    scores = over(np.real(queries @ items.conj().T), length(items))
    index = scores.argmax(-1)
    ranked = np.sort(scores, -1)
    runner_up = ranked[..., -2] if len(items) > 1 else np.full(index.shape, -np.inf)
    best = ranked[..., -1]
    margin = over(best - runner_up, length(queries)) if len(items) > 1 else np.full(index.shape, np.inf)
    return index, over(best, length(queries)), margin


def assert_matches(match: Match, expected: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    index, similarity, margin = (torch.from_numpy(np.asarray(x)) for x in expected)
    assert torch.equal(match.index, index)
    assert_close(match.similarity, similarity.to(torch.float32))
    assert_close(match.margin, margin.to(torch.float32))


@bounded
@given(data=st.data(), dtype=st.sampled_from([torch.int8, torch.int32, torch.float32, torch.float64]))
def test_answers_are_numpys(data: st.DataObject, dtype: torch.dtype) -> None:
    # Lengths of at most √12, so that items with equal cosines have equal quotients however the root is rounded.
    d, codes = data.draw(st.integers(1, 12)), st.integers(-1, 1)
    items = data.draw(hnp.arrays(np.int64, (data.draw(st.integers(1, 6)), d), elements=codes))
    queries = data.draw(hnp.arrays(np.int64, (2, 3, d), elements=codes))
    match = CleanUp(torch.from_numpy(items).to(dtype))(torch.from_numpy(queries).to(dtype))
    assert_matches(match, oracle(queries, items))


def test_every_space_is_cleaned_up(vsa: VSA) -> None:
    generator = torch.Generator().manual_seed(0)
    items = vsa.random(30, generator=generator)
    queries = vsa.bundle(vsa.random(4, 5, 3, generator=generator))
    queries[0, 0] = vsa.bundle(torch.stack([items[7], items[20], items[7]]))
    match = CleanUp(items)(queries)
    exact = [
        x.numpy().astype(np.complex128 if x.is_complex() else np.float64) for x in map(as_bipolar, (queries, items))
    ]
    expected = oracle(*exact)
    # Equal scores in whole numbers are rounded in floats: there any of the best will do.
    clear = torch.from_numpy(expected[2] > 1e-5)
    index = torch.where(clear, torch.from_numpy(expected[0]), match.index).numpy()
    assert_matches(match, (index, *expected[1:]))
    assert clear.double().mean() > 0.5  # sparse items often have the same score
    assert match.index[0, 0] == 7
    assert_close(match.similarity, vsa.similarity(queries, items[match.index]))


def test_raw_accumulators_are_cleaned_up(vsa: VSA) -> None:
    items = vsa.random(10, generator=torch.Generator().manual_seed(0))
    weights = torch.tensor([1, 1, 1, 5, 1, 1, 1, 1, 1, 1])
    match = CleanUp(items)(vsa.superpose(items, weights=weights))
    assert match.index == 3
    assert match.similarity.item() == pytest.approx(5 / 34**0.5, abs=0.05)


def test_types_give_the_same_answers() -> None:
    generator = torch.Generator().manual_seed(0)
    items = torch.randint(-1, 2, (50, 300), generator=generator, dtype=torch.int8)
    queries = torch.randint(-1, 2, (70, 300), generator=generator, dtype=torch.int8)
    reference = CleanUp(items)(queries)
    for item_type in (torch.int8, torch.int32, torch.float32, torch.float64):
        for query_type in (torch.int8, torch.int32, torch.float32):
            match = CleanUp(items.to(item_type))(queries.to(query_type))
            assert torch.equal(match.index, reference.index)
            # The length of a float query is rounded to its own type.
            rtol, atol = (3e-7, 1e-8) if query_type == torch.float32 else (0.0, 0.0)
            assert_close(match.similarity, reference.similarity, rtol=rtol, atol=atol)
            assert_close(match.margin, reference.margin, rtol=rtol, atol=atol)


def test_batches_give_the_bits_of_singles() -> None:
    generator = torch.Generator().manual_seed(0)
    vsa = torchvsa.MAP(999, dtype=torch.int8)
    memory, queries = CleanUp(vsa.random(20, generator=generator)), vsa.random(30, generator=generator)
    together = memory(queries)
    for size in (1, 7):
        parts = [memory(part) for part in queries.split(size)]
        for field, whole in enumerate(together):
            assert torch.equal(torch.cat([part[field] for part in parts]), whole)


@pytest.mark.parametrize("dtype", [torch.int8, torch.float32, torch.bool])
def test_equal_items_leave_no_margin_and_the_first_wins(dtype: torch.dtype) -> None:
    codes = torchvsa.BSC(100).random(3, generator=torch.Generator().manual_seed(0))
    items = codes if dtype == torch.bool else as_bipolar(codes).to(dtype)
    match = CleanUp(items[[2, 0, 1, 0, 1]])(items)
    assert match.index.tolist() == [1, 2, 0]
    assert match.margin[:2].tolist() == [0, 0]
    assert match.margin[2] > 0.5


def test_items_that_differ_in_length_alone_are_equal() -> None:
    match = CleanUp(torch.tensor([[2.0, 2], [1, 1], [4, 4]]))(torch.tensor([3.0, 3]))
    assert match.index == 0
    assert match.similarity == 1
    assert match.margin == 0


def test_a_single_item_has_no_rival() -> None:
    match = CleanUp(torch.ones(1, 4))(torch.tensor([[1.0, 1, 1, 1], [-1, -1, -1, -1]]))
    assert match.index.tolist() == [0, 0]
    assert match.similarity.tolist() == [1, -1]
    assert match.margin.tolist() == [torch.inf, torch.inf]


@pytest.mark.parametrize("dtype", [torch.int8, torch.int32, torch.float32, torch.complex64])
def test_a_zero_query_knows_nothing(dtype: torch.dtype) -> None:
    items = torch.eye(3).to(dtype)
    match = CleanUp(items)(torch.zeros(2, 3, dtype=dtype))
    for answer in match:
        assert answer.tolist() == [0, 0]


def test_no_queries_give_no_answers(vsa: VSA) -> None:
    match = CleanUp(vsa.random(3))(vsa.random(0))
    assert [field.shape for field in match] == [(0,)] * 3


def leading(shape: tuple[int, ...]) -> Tensor:
    return torch.randn(*shape, 8, generator=torch.Generator().manual_seed(0))


@pytest.mark.parametrize("shape", [(), (1,), (5,), (2, 3), (2, 1, 3)])
def test_leading_dimensions_are_batches(shape: tuple[int, ...]) -> None:
    memory = CleanUp(torch.randn(6, 8, generator=torch.Generator().manual_seed(1)))
    match, flat = memory(leading(shape)), memory(leading(shape).reshape(-1, 8))
    for field, rows in zip(match, flat, strict=True):
        assert field.shape == shape
        assert torch.equal(field.flatten(), rows)
