"""Ridge regression of a program: the system that is solved, and the weight of the ridge."""

from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Float, Float64, Int64, Shaped
from torch import Tensor

from behaviours.learning.conditions import LazyConditions
from behaviours.options import as_float
from behaviours.progress import Progress, no_progress
from torchvsa import VSA
from torchvsa._numerics import as_bipolar, is_integer

ROWS = 4096
"""So many conditions are held as floats at once."""
RIDGES = (1.0, 1e-1, 1e-2, 1e-3, 1e-4)
"""The weights that `chosen_ridge` compares."""
_CHOSEN_FROM = 2500
"""The weight is chosen with at most this many conditions: the best one hardly depends on their number."""

_BLOCK = 1024
"""So many rows of the matrix are computed at once, so that nothing else is as large as it."""

EXACT = 1e-3
"""A weight that is small enough to recall what was shown."""
_FEW = 100
"""Fewer conditions do not tell noise from what was meant."""


def has_ridge(vsa: VSA) -> bool:
    """Whether the architecture binds real numbers element by element, which the closed form needs."""
    return vsa.elementwise and not vsa.dtype.is_complex


@dataclass(frozen=True)
class RidgeSystem:
    """The equations of the program that comes nearest to the targets, see `solve`."""

    vsa: VSA
    matrix: Float64[Tensor, "n n"]
    target: Float64[Tensor, "n"]
    rows: Float[Tensor, "n d"] | None
    """In the dual form, what the solution is multiplied with."""
    scale: float
    """The mean squared length of a pair, by which a ridge is multiplied."""

    @classmethod
    def of(
        cls,
        vsa: VSA,
        conditions: Shaped[Tensor, "k d"] | LazyConditions,
        items: Shaped[Tensor, "r d"],
        targets: Float64[Tensor, "k r"],
        weights: Float64[Tensor, "k"] | None = None,
        progress: Progress = no_progress,
    ) -> "RidgeSystem":
        """The system of these pairs. Raises `ValueError` unless the architecture binds real numbers by elements."""
        if not has_ridge(vsa):
            raise ValueError(
                f"least squares needs element-wise binding of real numbers, which {vsa.name} lacks; use ErrorDriven or "
                "Gradient"
            )
        # Sums of fewer than 2^24 products of -1 and +1 are exact in float32, which is twice as fast.
        kind = torch.float32 if is_integer(conditions[:1]) and is_integer(items) else torch.float64
        r = as_bipolar(items).to(kind)
        pairs = len(conditions) * len(r)
        if weights is None:
            weights = torch.ones(len(conditions), dtype=torch.float64, device=r.device)
        if pairs <= vsa.dim:
            rows = (as_bipolar(conditions[:]).to(kind)[:, None] * r).flatten(0, 1)
            scale = float(rows.to(torch.float64, copy=True).square_().sum()) / pairs
            # A row of weight w is √w times as long.
            roots = weights.sqrt().repeat_interleave(len(r))
            matrix = (rows @ rows.T).double().mul_(roots[:, None]).mul_(roots)
            progress(1.0)
            rows = rows.to(torch.float64, copy=True).mul_(roots[:, None])
            return cls(vsa, matrix, roots * targets.reshape(-1), rows, scale)
        # Element-wise binding makes the d × d matrix of all pairs a product of two small ones. It is a sum over the
        # conditions, which need not be held at once.
        matrix = torch.zeros(vsa.dim, vsa.dim, dtype=torch.float64, device=r.device)
        target, squares = (torch.zeros(vsa.dim, dtype=torch.float64, device=r.device) for _ in range(2))
        blocks = [slice(start, start + _BLOCK) for start in range(0, vsa.dim, _BLOCK)]
        done = 0
        for part in conditions.split(ROWS):
            c, here = as_bipolar(part).to(kind), slice(done, done + len(part))
            weight = weights[here, None].to(kind)
            weighted = c if (weight == 1).all() else weight * c
            for block in blocks:
                matrix[block] += c[:, block].T @ weighted
                target[block] += (targets[here] @ r[:, block].double()).mul_(weighted[:, block]).sum(0)
                squares[block] += (c[:, block].double() ** 2).sum(0)
            done += len(part)
            progress(done / len(conditions))
        for block in blocks:
            matrix[block] *= r[:, block].T @ r
        return cls(vsa, matrix, target, None, float(squares @ (r.double() ** 2).sum(0)) / pairs)

    def program(self, ridge: float, overwrite: bool = False) -> Float[Tensor, "d"]:
        """The solution; with `overwrite` it takes the memory of the matrix, so that the system cannot be solved again.

        Raises `ValueError` if there is no solution in floats with this ridge.
        """
        # The transpose of a symmetric matrix is the same one, but column by column, in which it is factored in place.
        matrix = (self.matrix if overwrite else self.matrix.clone()).mT
        matrix.diagonal().add_(ridge * self.scale)
        failed = torch.empty((), dtype=torch.int32, device=matrix.device)
        factor, failed = torch.linalg.cholesky_ex(matrix, out=(matrix, failed))
        if failed:
            raise ValueError(f"ridge={ridge:g} is too small: the system cannot be solved in float64; take a larger one")
        half = torch.linalg.solve_triangular(factor, self.target[:, None], upper=False)
        solution = torch.linalg.solve_triangular(factor.mT, half, upper=True)[:, 0]
        program = solution if self.rows is None else self.rows.T @ solution
        program = program.to(torch.float64 if self.vsa.dtype == torch.float64 else torch.float32)
        if not program.isfinite().all():
            raise ValueError(f"ridge={ridge:g} leaves no finite solution; take one nearer to 1")
        return program


def solve(
    vsa: VSA,
    conditions: Shaped[Tensor, "k d"] | LazyConditions,
    items: Shaped[Tensor, "r d"],
    targets: Float64[Tensor, "k r"],
    ridge: float,
    weights: Float64[Tensor, "k"] | None = None,
    progress: Progress = no_progress,
) -> Float[Tensor, "d"]:
    """The program p that minimises the sum over k and r of w_k (<c_k ⊗ r_r, p> - target)² plus `ridge` times s·|p|².

    `s` is the mean squared length of a pair c ⊗ r, and w_k the weight of a condition, by default 1. With k·r pairs the
    system has k·r unknowns in the dual and d in the primal form; the smaller one is solved, in float64.

    Args:
        vsa: The architecture of the hypervectors.
        conditions: The conditions c; those that are encoded on access are not held at once in the primal form.
        items: The hypervectors r that they are bound with.
        targets: The target score of each pair.
        ridge: The weight of the squared length of p, above 0.
        weights: The weight of each condition, above 0.
        progress: Called with the completed fraction of the work.

    Raises:
        ValueError: If the architecture has no element-wise binding of real numbers, if `ridge` is not above 0, and if
            the system has no solution in floats with it.
    """
    ridge = check_ridge(ridge)
    system = RidgeSystem.of(vsa, conditions, items, targets, weights, lambda done: progress(0.4 * done))
    program = system.program(ridge, overwrite=True)
    progress(1.0)
    return program


def chosen_ridge(
    vsa: VSA,
    conditions: Shaped[Tensor, "k d"] | LazyConditions,
    items: Shaped[Tensor, "r d"],
    targets: Float64[Tensor, "k r"],
    weights: Float64[Tensor, "k"] | None,
    generator: torch.Generator,
) -> float:
    """The one of `RIDGES` with the smallest error on a fifth of the conditions, which the program was not fitted to.

    Noisy demonstrations need a large weight, exact ones a small one. At most 2,500 conditions, drawn at random, take
    part; fewer than 100 get 1e-3. Arguments as those of `solve`.
    """
    count = min(len(conditions), _CHOSEN_FROM)
    if count < _FEW:
        return EXACT
    order = torch.randperm(len(conditions), generator=generator)[:count].to(targets.device)
    held, rest = order[: count // 5], order[count // 5 :]

    def of(index: Int64[Tensor, "i"]) -> tuple[Any, ...]:
        return conditions[index], targets[index], None if weights is None else weights[index]

    (fitted, wanted, weighted), (asked, known, counted) = of(rest), of(held)
    system = RidgeSystem.of(vsa, fitted, items, wanted, weighted)
    errors = []
    for ridge in RIDGES:
        readout = vsa.readout(system.program(ridge), items)
        squares = ((readout(asked) * readout.lengths - known) ** 2).sum(1)
        errors.append(float((squares if counted is None else squares * counted).sum()))
    return RIDGES[errors.index(min(errors))]


def check_ridge(ridge: Any) -> float:
    """The weight of the squared length of the program as a float. Raises `ValueError` unless it is above 0."""
    return as_float("ridge", ridge, 0, above=True)
