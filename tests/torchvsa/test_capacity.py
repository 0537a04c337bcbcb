"""How many hypervectors one bundle holds: the dimension that published measurements need for 15 of 1,000 atoms.

The first dimension with a mean accuracy of .99, refitted from the raw results of a public toolbox, for 15 atoms in
a bundle (found as its 15 nearest) and for 15 bound pairs (unbound one by one). Over 10 repetitions of 15 the mean
has a standard deviation of .008. The closed forms must agree with them, and with simulations of their own.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

import torchvsa
from torchvsa import VSA, dim_needed, pairs_held, recall_probability
from torchvsa.capacity import CLOSED_FORMS, winner_probability

NEEDED = {
    "MAP-B": (790, 780),
    "MAP-C": (640, 620),
    "MAP-I": (470, 490),
    "HRR": (510, 520),
    "FHRR": (330, 340),
    "BSC": (750, 750),
}


def space(name: str, dim: int) -> VSA:
    # The measurements of MAP-C used uniform atoms.
    return torchvsa.MAP(dim, atoms="uniform") if name == "MAP-C" else torchvsa.architecture(name, dim)


def members(name: str, dim: int) -> float:
    vsa = space(name, dim)
    found = 0.0
    for seed in range(10):
        atoms = vsa.random(1000, generator=torch.Generator().manual_seed(seed))
        nearest = vsa.similarity(vsa.bundle(atoms[:15]), atoms).topk(15).indices
        found += (nearest < 15).float().mean().item()
    return found / 10


def pairs(name: str, dim: int) -> float:
    vsa = space(name, dim)
    right = 0.0
    for seed in range(10):
        atoms = vsa.random(1000, generator=torch.Generator().manual_seed(seed))
        keys, values = atoms[:15], atoms[15:30]
        match = torchvsa.CleanUp(atoms)(vsa.unbind(vsa.bundle(vsa.bind(keys, values)), keys))
        right += (match.index == torch.arange(15, 30)).float().mean().item()
    return right / 10


@pytest.mark.parametrize("name", NEEDED)
def test_a_bundle_holds_as_much_as_measured_elsewhere(name: str) -> None:
    dim = NEEDED[name][0]
    assert 0.95 < members(name, dim) <= 1
    assert members(name, dim // 2) < 0.95


@pytest.mark.parametrize("name", NEEDED)
def test_a_program_of_bound_pairs_holds_as_much_as_measured_elsewhere(name: str) -> None:
    dim = NEEDED[name][1]
    assert 0.95 < pairs(name, dim) <= 1
    assert pairs(name, dim // 2) < 0.95


def drawn(name: str, dim: int, k: int, items: int, trials: int) -> float:
    """The recall of k bundled pairs in a plain simulation, which shares no code with the library."""
    rng = np.random.default_rng([dim, k])
    uniform = name == "MAP-C uniform"
    right = 0
    for _ in range(trials):
        atoms = rng.uniform(-1, 1, (items, dim)) if uniform else rng.choice([-1.0, 1.0], (items, dim))
        keys = np.ones((k, dim)) if uniform else rng.choice([-1.0, 1.0], (k, dim))
        # Anywhere among the items, so that equal scores favour nobody.
        own = rng.permutation(items)[:k]
        total = (keys * atoms[own]).sum(0)
        if name in ("MAP-B", "BSC") and k % 2 == 0:
            total += rng.choice([-1.0, 1.0], dim)
        bundled = total if name == "MAP-I" else np.clip(total, -1, 1)
        scores = (keys * bundled) @ atoms.T
        if uniform:
            # Members have no keys: each competes with strangers alone.
            strangers = np.delete(scores, own, 1).max(1)
            right += int((scores[np.arange(k), own] > strangers).sum())
        else:
            right += int((scores.argmax(1) == own).sum())
    return right / (k * trials)


@pytest.mark.parametrize("name", ["MAP-I", "MAP-B", "MAP-C", "BSC", "MAP-C uniform"])
@pytest.mark.parametrize("k", [1, 2, 15, 24])
def test_the_closed_form_is_what_a_simulation_tends_to(name: str, k: int) -> None:
    atoms = "uniform" if name.endswith("uniform") else "bipolar"
    measured = drawn(name, 300, k, 200, 150)  # a deviation of at most .01 with the 2,250 decisions of k = 15
    formula = recall_probability(name.split()[0], 300, k, 200 - (k - 1 if atoms == "uniform" else 0), atoms)
    assert measured == pytest.approx(formula, abs=0.025)
    if k in (1, 2):
        assert formula > 0.999


def test_the_closed_form_of_clipped_uniform_atoms() -> None:
    assert recall_probability("MAP-C", 300, 15, 1000, "uniform") == pytest.approx(0.747, abs=0.0005)


@pytest.mark.parametrize(
    ("name", "atoms", "slope", "start"),
    [
        ("MAP-B", "bipolar", 49.3, 40.2),
        ("MAP-I", "bipolar", 32.4, 7.2),
        ("BSC", "bipolar", 49.9, 1.2),
        ("MAP-C", "uniform", 44.3, -27.2),  # the members of a bundle, not its pairs
    ],
)
def test_the_closed_form_needs_the_dimensions_of_published_measurements(
    name: str, atoms: Any, slope: float, start: float
) -> None:
    for k in (15, 33, 51):
        assert dim_needed(name, k, 1000, atoms=atoms) == pytest.approx(slope * k + start, rel=0.06)


@pytest.mark.parametrize("name", list(CLOSED_FORMS))
@pytest.mark.parametrize("items", [2, 9, 1000])
def test_the_inverses_turn_the_closed_form_around(name: str, items: int) -> None:
    for accuracy in (0.9, 0.99):
        dim = dim_needed(name, 20, items, accuracy)
        assert recall_probability(name, dim, 20, items) >= accuracy > recall_probability(name, dim - 1, 20, items)
        held = pairs_held(name, 1000, items, accuracy)
        assert recall_probability(name, 1000, held, items) >= accuracy
        assert all(recall_probability(name, 1000, held + more, items) < accuracy for more in range(1, 9))
    assert pairs_held(name, 2, 1000) == 0


def test_the_winner_among_equals_is_any_of_them() -> None:
    """A score without signal among N is the largest with probability 1/N; with two, Φ(s/√2) is exact."""
    for items in (1, 2, 3, 1000):
        assert winner_probability(0.0, 1.0, items) == pytest.approx(1 / items, rel=1e-9)
    for signal in (-1.0, 0.5, 3.0):
        exact = 0.5 * math.erfc(-signal / 2)
        assert winner_probability(signal, 1.0, 2) == pytest.approx(exact, rel=1e-12)
    assert winner_probability(2.0, 0.0, 11) == pytest.approx((0.5 * math.erfc(-math.sqrt(2))) ** 10, rel=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: recall_probability("HRR", 100, 3, 9), "no closed form for 'HRR'"),
        (lambda: recall_probability("MAP-B", 100, 3, 9, "uniform"), "'uniform' with MAP-C"),
        (lambda: recall_probability("MAP-I", 0, 3, 9), "dim and pairs are at least 1"),
        (lambda: recall_probability("MAP-I", 9, 3, 0), "items is at least 1"),
        (lambda: dim_needed("MAP-I", 3, 9, 1.0), "between 0 and 1"),
        (lambda: pairs_held("MAP-I", 100, 1), "1 item"),
    ],
)
def test_what_has_no_answer_is_refused(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call()
