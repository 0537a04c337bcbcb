"""Least squares: the ridge solution itself, in whichever form it is solved."""

import numpy as np
import pytest
import torch
from robots import correct, random_pairs, space

import torchvsa
from behaviours import Demonstrations, LeastSquares
from behaviours.learning.least_squares import solve


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
        correct(LeastSquares().fit(space(4000, protection={"name": "self_shift", "width": "sum"}), shown), shown).mean()
        > 0.99
    )


def test_contradictions_are_answered_by_their_shares() -> None:
    shown = Demonstrations([[1.0, 1, 1]] * 3, [[0.0, 1], [1, 1], [1, 1]])
    behaviour = LeastSquares().fit(space(1000), shown)
    assert behaviour([[1.0, 1, 1]]).commands.tolist() == [[1, 1]]
    assert behaviour.report.contradicting == 1


def test_architectures_without_a_closed_form_are_refused() -> None:
    for name in ("HRR", "FHRR"):
        with pytest.raises(ValueError, match=f"element-wise binding of real numbers, which {name} lacks"):
            LeastSquares().fit(space(64, name), random_pairs(3))
