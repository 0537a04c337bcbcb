"""Resonator networks against a NumPy transcription, and what they promise."""

from typing import Any

import numpy as np
import pytest
import torch
from readings import seeded
from torch import Tensor

import torchvsa
from torchvsa import MAP, VSA, Resonator, ShapeError

STOCHASTIC: dict[str, Any] = {"noise": 0.5, "threshold": 1.5}


def problem(vsa: VSA, sizes: tuple[int, ...], rows: int, seed: int = 0) -> tuple[list[Tensor], Tensor, Tensor]:
    """Random codebooks, and the products of items of random indices."""
    generator = seeded(seed)
    books = [vsa.random(size, generator=generator) for size in sizes]
    indices = torch.stack([torch.randint(size, (rows,), generator=generator) for size in sizes], 1)
    bound = books[0][indices[:, 0]]
    for book, index in zip(books[1:], indices.unbind(1)[1:], strict=True):
        bound = vsa.bind(bound, book[index])
    return books, indices, bound


def oracle(bound: np.ndarray, books: list[np.ndarray], steps: int) -> tuple[list[int], int]:
    """One bound vector of -1 / +1: the items and the number of steps, by the printed equations."""

    def sign(x: np.ndarray) -> np.ndarray:
        return np.where(x < 0, -1, 1)

    states = [sign(book.sum(0)) for book in books]
    seen: list[list[list[int]]] = []
    found: list[int] = []
    for step in range(1, steps + 1):
        similarities = []
        for place, book in enumerate(books):
            others = [state for other, state in enumerate(states) if other != place]
            similarities.append(book @ np.prod([bound, *others], axis=0))
            states[place] = sign(book.T @ similarities[-1])
        found = [int(np.abs(each).argmax()) for each in similarities]
        certain = all(np.abs(each).max() >= 0.6 * len(bound) for each in similarities)
        seen.append([each.tolist() for each in similarities])
        if certain or (len(seen) > 1 and seen[-1] == seen[-2]):
            return found, step
        marked = 2 ** int(np.log2(step - 1)) if step > 1 else 0
        if marked and seen[marked - 1] == seen[-1]:
            return found, step
    return found, steps


@pytest.mark.parametrize("sizes", [(5, 4), (12, 9, 7), (14, 14, 14)])
def test_it_takes_the_steps_of_the_printed_equations(sizes: tuple[int, ...]) -> None:
    books, _, bound = problem(MAP(61, dtype=torch.int8), sizes, 12)
    found = Resonator(MAP(61, dtype=torch.int8), books, steps=40)(bound)
    arrays = [book.numpy().astype(int) for book in books]
    for row, vector in enumerate(bound.numpy().astype(int)):
        indices, steps = oracle(vector, arrays, 40)
        assert (found.indices[row].tolist(), found.steps[row]) == (indices, steps)
        product = np.prod([book[index] for book, index in zip(arrays, indices, strict=True)], axis=0)
        assert found.similarity[row] == pytest.approx(product @ vector / 61, abs=1e-6)


@pytest.mark.parametrize("name", ["MAP-C", "MAP-B", "MAP-I", "BSC", "FHRR"])
@pytest.mark.parametrize("options", [{}, STOCHASTIC], ids=["plain", "stochastic"])
def test_factors_are_found_with_the_same_bits_in_any_batch(name: str, options: dict[str, Any]) -> None:
    vsa = torchvsa.architecture(name, 400)
    books, indices, bound = problem(vsa, (12, 9, 7), 20)
    resonator = Resonator(vsa, books, **options)
    found = resonator(bound, seeded(1))
    assert torch.equal(found.indices, indices)
    assert found.similarity.min() > 0.999
    assert found.converged.all()
    generator = seeded(1)
    parts = [resonator(part, generator) for part in bound.split(7)]
    for field, whole in enumerate(found):
        assert torch.equal(torch.cat([part[field] for part in parts]), whole)
    assert torch.equal(resonator(bound.view(4, 5, -1), seeded(1)).indices, indices.view(4, 5, 3))


def test_the_capacity_is_the_published_one() -> None:
    """Kent et al. 2020: two codebooks of 340 items at d = 1,000 are factored in 99 %, within .001 · 340² steps."""
    right = [
        [
            float((Resonator(vsa, books, steps=115)(bound).indices == indices).all(1).float().mean())
            for seed in range(2)
            for books, indices, bound in [problem(vsa, (size, size), 60, seed)]
        ]
        for vsa in [MAP(1000, dtype=torch.int8)]
        for size in (310, 450)
    ]
    assert np.mean(right[0]) > 0.98
    assert np.mean(right[1]) < 0.9


def test_noise_and_a_threshold_find_factors_in_larger_sets() -> None:
    vsa = MAP(256, dtype=torch.int8)
    books, indices, bound = problem(vsa, (50, 50, 50), 30)
    shares = [
        float((Resonator(vsa, books, **options)(bound, seeded(2)).indices == indices).all(1).float().mean())
        for options in ({}, STOCHASTIC)
    ]
    assert shares[0] < 0.6
    assert shares[1] > 0.9


def test_a_sum_of_products_is_searched_for_one_of_them_whatever_its_scale() -> None:
    vsa = MAP(1000, dtype=torch.int8)
    books, indices, bound = problem(vsa, (9, 9, 9), 5)
    total = vsa.superpose(bound)
    for given in (total, total.double() / 3, total.float() * 1e20, total.to(torch.int64) * 10**7):
        found = Resonator(vsa, books, accept=0.3)(given)
        assert found.indices.tolist() in indices.tolist()
        assert found.similarity == pytest.approx(1 / 5**0.5, abs=0.1)


def test_what_has_no_factors_says_so() -> None:
    vsa = MAP(300, dtype=torch.int8)
    books, _, _ = problem(vsa, (60, 60), 1)
    found = Resonator(vsa, books, steps=100)(vsa.random(30, generator=seeded(8)))
    assert found.similarity.abs().max() < 0.4
    assert not found.converged.any()
    assert found.steps.tolist() == [100] * 30


def test_a_cycle_ends_a_row_that_has_not_converged() -> None:
    vsa = MAP(40, dtype=torch.int8)
    books, _, _ = problem(vsa, (12, 12), 1)
    found = Resonator(vsa, books, steps=500, accept=2.0)(vsa.random(60, generator=seeded(8)))
    assert ((found.steps < 500) & ~found.converged).any()
    assert found.converged.any()


def test_no_products_have_no_factors() -> None:
    vsa = MAP(300, dtype=torch.int8)
    books, _, _ = problem(vsa, (60, 60), 1)
    nothing = Resonator(vsa, books)(torch.zeros(2, 300))
    assert nothing.similarity.tolist() == [0, 0]
    assert Resonator(vsa, books)(torch.zeros(0, 300)).indices.shape == (0, 2)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda vsa, books: Resonator(torchvsa.HRR(64), books), "element-wise binding .* got HRR"),
        (lambda vsa, books: Resonator(MAP(64, atoms="uniform"), books), "element-wise binding"),
        (lambda vsa, books: Resonator(vsa, books[:1]), "at least two codebooks; got 1"),
        (lambda vsa, books: Resonator(vsa, [books[0], 2 * books[1]]), "codebook 1 must hold codes"),
        (lambda vsa, books: Resonator(vsa, books, steps=0), "steps is a positive integer; got 0"),
        (lambda vsa, books: Resonator(vsa, books, noise=-1), "noise is a number of 0 or more; got -1"),
        (lambda vsa, books: Resonator(vsa, books, noise=1)(books[0]), "needs a generator"),
        (lambda vsa, books: Resonator(vsa, books)(torch.full((2, 64), torch.nan)), "row 0 holds NaN"),
    ],
)
def test_bad_input_is_named(make: Any, words: str) -> None:
    vsa = MAP(64)
    with pytest.raises(ValueError, match=words):
        make(vsa, problem(vsa, (3, 4), 1)[0])


def test_wrong_shapes_are_named() -> None:
    vsa = MAP(64)
    books, _, _ = problem(vsa, (3, 4), 1)
    with pytest.raises(ShapeError, match="bound must end in d = 64"):
        Resonator(vsa, books)(torch.ones(3))
    with pytest.raises(ShapeError, match="codebook 0 must be"):
        Resonator(vsa, [books[0][0], books[1]])
