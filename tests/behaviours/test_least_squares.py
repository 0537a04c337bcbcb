"""Least squares: the ridge solution itself, in whichever form it is solved."""

import numpy as np
import pytest
import torch
from robots import correct, random_pairs
from robots import space as small

import torchvsa
from behaviours import Actuator, Demonstrations, LeastSquares, Schema, Sensor, Space
from behaviours.learning.conditions import LazyConditions
from behaviours.learning.ridge import chosen_ridge, solve


def plain(conditions: torch.Tensor, items: torch.Tensor, targets: torch.Tensor, ridge: float) -> np.ndarray:
    """The textbook's formula, pair by pair."""
    pairs = [(c * r, t) for c, row in zip(conditions, targets, strict=True) for r, t in zip(items, row, strict=True)]
    rows = np.array([(pair.double().numpy()) for pair, _ in pairs])
    aims = np.array([float(t) for _, t in pairs])
    weight = ridge * (rows**2).sum(1).mean()
    return np.linalg.solve(rows.T @ rows + weight * np.eye(rows.shape[1]), rows.T @ aims)


@pytest.mark.parametrize("dtype", [torch.int8, torch.float32, torch.float64])
@pytest.mark.parametrize("count", [4, 10, 11, 40])
def test_primal_and_dual_are_the_ridge_solution(count: int, dtype: torch.dtype) -> None:
    vsa = torchvsa.MAP(30, dtype=dtype)
    generator = torch.Generator().manual_seed(count)
    conditions, items = vsa.random(count, generator=generator), vsa.random(3, generator=generator)
    targets = torch.randn(count, 3, generator=generator, dtype=torch.float64)
    program = solve(vsa, conditions, items, targets, 0.3)
    assert program.dtype == (torch.float64 if dtype == torch.float64 else torch.float32)
    np.testing.assert_allclose(program.numpy(), plain(conditions, items, targets, 0.3), rtol=1e-4, atol=1e-6)


def test_pairs_that_fit_are_answered_with_one_and_zero() -> None:
    generator = torch.Generator().manual_seed(0)
    vsa = torchvsa.MAP(1000)
    conditions, items = vsa.random(40, generator=generator), vsa.random(9, generator=generator)
    own = torch.eye(9, dtype=torch.float64)[torch.arange(40) % 9]
    program = solve(vsa, conditions, items, own, 1e-9)
    torch.testing.assert_close(conditions @ (items * program).T, own.float(), atol=1e-4, rtol=0)


def test_it_recalls_what_one_superposition_cannot() -> None:
    shown = random_pairs(400)
    assert (
        correct(LeastSquares().fit(small(4000, protection={"name": "self_shift", "width": "sum"}), shown), shown).mean()
        > 0.99
    )


def test_contradictions_are_answered_by_their_shares() -> None:
    shown = Demonstrations([[1.0, 1, 1]] * 3, [[0.0, 1], [1, 1], [1, 1]])
    behaviour = LeastSquares().fit(small(1000), shown)
    assert behaviour([[1.0, 1, 1]]).commands.tolist() == [[1, 1]]
    assert behaviour.report.contradicting == 1


def test_architectures_without_a_closed_form_are_refused() -> None:
    for name in ("HRR", "FHRR"):
        with pytest.raises(ValueError, match=f"element-wise binding of real numbers, which {name} lacks"):
            LeastSquares().fit(small(64, name), random_pairs(3))


@pytest.mark.parametrize(("noise", "least", "most"), [(0.0, 1e-4, 1e-2), (3.0, 1e-1, 1.0)])
def test_the_chosen_ridge_is_large_where_targets_are_noisy(noise: float, least: float, most: float) -> None:
    generator = torch.Generator().manual_seed(0)
    vsa = torchvsa.MAP(1000, dtype=torch.int8)
    conditions, items, truth = (
        vsa.random(600, generator=generator),
        vsa.random(1, generator=generator),
        torch.zeros(1000),
    )
    truth[:5] = 1.0
    targets = (conditions.double() * items @ truth.double())[:, None]
    targets += noise * torch.randn(600, 1, generator=generator, dtype=torch.float64)
    chosen = [
        chosen_ridge(vsa, conditions, items, targets, weights, torch.Generator().manual_seed(1))
        for weights in (None, torch.ones(600, dtype=torch.float64))
    ]
    assert chosen[0] == chosen[1]
    assert least <= chosen[0] <= most


def test_conditions_that_are_encoded_on_access_give_the_same_program() -> None:
    generator = torch.Generator().manual_seed(0)
    space = Space(Schema([Sensor("x", 0, 1), Sensor("y", 0, 1)], [Actuator("u", -1, 1, levels=3)]))
    cells = space.cells(torch.rand(5000, 2, generator=generator))
    conditions, items = space.encode(cells), space.vsa.random(2, generator=generator)
    targets = torch.randn(5000, 2, generator=generator, dtype=torch.float64)
    weights = torch.randint(1, 4, (5000,), generator=generator).double()
    for given in (None, weights):
        held = solve(space.vsa, conditions, items, targets, 0.1, given)
        assert torch.equal(held, solve(space.vsa, LazyConditions(space, cells), items, targets, 0.1, given))
    twice = torch.arange(5000).repeat_interleave(weights.long())
    again = solve(space.vsa, conditions[twice], items, targets[twice], 0.1)
    torch.testing.assert_close(held, again, atol=1e-6, rtol=1e-4)
