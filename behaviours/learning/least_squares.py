"""Learn a program in closed form, by ridge regression."""

from dataclasses import dataclass
from typing import Any, Literal

import torch
from jaxtyping import Float, Float64, Shaped
from torch import Tensor
from torch.nn import functional

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule
from behaviours.learning.conditions import LazyConditions
from behaviours.learning.convergence import FEW, warn_if_wrong
from behaviours.learning.samples import Contradictions, Samples, check_contradictions
from behaviours.options import as_bool, as_float, set_fields
from behaviours.progress import Progress, no_progress, subrange
from behaviours.space import Space
from torchvsa import VSA
from torchvsa._numerics import as_bipolar, is_integer, norms


@dataclass(frozen=True)
class LeastSquares(Rule):
    """Ridge regression for the program: the target score of a condition is 1 for its result and 0 for all others.

    For a condition shown with several results the targets are the share of each (`contradictions="all"`), or 1 for the
    `"first"`, the `"majority"` or the `"latest"` alone. `ridge` is the weight of the squared length of the program, in
    units of the squared length of one stored pair.

    `evidence` makes what was shown often louder: the target scores of a condition that was shown n times are multiplied
    by `1 + evidence · log(1 + n)`. On `silent` conditions all targets are 0.

    `smooth` makes a behaviour whose commands are not rounded to levels (see `Behaviour`): the targets are the mean
    commands of each condition, on a scale from -1 to 1, and every sample counts. Its report counts as `wrong` the
    conditions whose command is off by more than half a level. On `silent` conditions it commands the middle of the
    range.

    The closed form needs element-wise binding of real numbers; `fit` raises `ValueError` for other architectures. The
    program is a float vector.

    Source: ridge regression, Hoerl and Kennard 1970.
    """

    name = "least_squares"
    integer_programs = False
    supports_silence = True

    ridge: float = 1e-3
    contradictions: Contradictions | Literal["all"] = "all"
    evidence: float = 0.0
    smooth: bool = False

    def __post_init__(self) -> None:
        check_contradictions(self.contradictions, "all")
        set_fields(
            self,
            ridge=check_ridge(self.ridge),
            evidence=as_float("evidence", self.evidence, 0),
            smooth=as_bool("smooth", self.smooth),
        )
        if self.smooth and (self.contradictions != "all" or self.evidence):
            raise ValueError(
                "smooth commands are means over all samples, so that smooth=True takes contradictions='all' and "
                f"evidence=0; got contradictions={self.contradictions!r} and evidence={self.evidence:g}"
            )

    @classmethod
    def supports(cls, vsa: VSA) -> bool:
        """Whether the architecture binds real numbers element by element; see `Rule.supports`."""
        return vsa.elementwise and not vsa.dtype.is_complex

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        """Learn a behaviour, see `Rule.fit`.

        Raises `ValueError` for an architecture that is not supported, and for a `ridge` with which the system has no
        solution in floats.
        """
        shown = Samples.of(space, demonstrations, subrange(progress, 0, 0.2))
        return (
            self._learn_smooth(space, shown, demonstrations, progress)
            if self.smooth
            else self._learn(space, shown, progress)
        )

    def fit_beside(
        self, space: Space, demonstrations: Demonstrations, silent: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        """Learn a behaviour that is silent where others have an opinion, see `Rule.fit_beside`."""
        shown = Samples.of(space, demonstrations, subrange(progress, 0, 0.2), silent)
        return (
            self._learn_smooth(space, shown, demonstrations, progress)
            if self.smooth
            else self._learn(space, shown, progress)
        )

    def _learn_smooth(
        self, space: Space, samples: Samples, demonstrations: Demonstrations, progress: Progress
    ) -> Behaviour:
        actuators, device = space.schema.actuators, samples.condition.device
        low, high = (
            torch.tensor([getattr(actuator, end) for actuator in actuators], dtype=torch.float64, device=device)
            for end in ("low", "high")
        )
        shares = 2 * (demonstrations.commands.to(device, torch.float64) - low) / (high - low) - 1
        counts = torch.bincount(samples.condition).to(torch.float64)
        targets = torch.zeros(len(counts), len(actuators), dtype=torch.float64, device=device)
        targets.index_add_(0, samples.condition, shares).div_(counts[:, None])
        conditions = fitted = samples.conditions
        wanted, weights = targets, counts
        if samples.silent is not None:
            fitted = torch.cat([conditions[:], samples.silent[:]])
            wanted = functional.pad(targets, (0, 0, 0, len(samples.silent)))
            weights = functional.pad(counts, (0, len(samples.silent)), value=1.0)
        roles = space.result_encoder.roles
        # Scores are divided by the lengths of the roles.
        program = solve(
            space.vsa, fitted, roles, wanted * norms(roles), self.ridge, weights, subrange(progress, 0.2, 0.9)
        )
        readout = space.vsa.readout(program, roles)
        commanded = torch.cat([readout(rows).clamp(-1, 1) for rows in conditions.split(_ROWS)])
        steps = torch.tensor([actuator.levels - 1 for actuator in actuators], device=device)
        report = samples.report(
            self.name,
            contradicting=int((samples.targets("majority")[samples.condition] != samples.result).sum()),
            wrong=int(((commanded - targets).abs() * steps > 1).any(1).sum()),
        )
        progress(1.0)
        known = samples.condition_sum(space.vsa)
        return Behaviour(space, program, known, samples.results, report, smooth=True)

    def _learn(self, space: Space, shown: Samples, progress: Progress) -> Behaviour:
        samples = shown if self.contradictions == "all" else shown.resolved(self.contradictions)
        shape = len(samples.conditions), len(samples.results)
        cells = samples.condition * shape[1] + samples.result
        counts = torch.bincount(cells, minlength=shape[0] * shape[1]).view(shape).to(torch.float64)
        items = space.items(samples.results)
        targets = counts / counts.sum(1, keepdim=True) * (1 + self.evidence * samples.evidence()[:, None])
        conditions = fitted = samples.conditions
        if samples.silent is not None:
            fitted = torch.cat([conditions[:], samples.silent[:]])
            targets = functional.pad(targets, (0, 0, 0, len(samples.silent)))
        every = samples.items(space)
        targets = functional.pad(targets, (0, len(every) - len(items)))
        program = solve(space.vsa, fitted, every, targets, self.ridge, progress=subrange(progress, 0.2, 0.9))
        readout = space.vsa.readout(program, items)
        predicted = torch.cat([readout(rows).argmax(1) for rows in conditions.split(_ROWS)])
        report = samples.report(
            self.name,
            contradicting=int((counts.argmax(1)[shown.condition] != shown.result).sum()),
            wrong=int((predicted != counts.argmax(1)).sum()),
        )
        progress(1.0)
        warn_if_wrong(
            type(self).__name__,
            int(samples.missed(predicted).sum()),
            len(counts),
            contradicting=report.contradicting,
            samples=report.samples,
            after="",
            remedy="more dimensions (dim) or a smaller ridge",
            tolerated=FEW,
        )
        return Behaviour(space, program, samples.condition_sum(space.vsa), samples.results, report)

    def partial_fit(
        self, behaviour: Behaviour, demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        """Raises `ValueError`: the solution cannot be updated from the program alone."""
        raise ValueError(
            "least squares cannot continue from a program: it also needs the covariance of all earlier pairs, d by d "
            "numbers that a behaviour does not keep; give all demonstrations at once, to fit, or continue with "
            "ErrorDriven or Gradient"
        )


_ROWS = 4096
"""So many conditions are held as floats at once."""


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
    if not LeastSquares.supports(vsa):
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
        weight = ridge * float((rows.double() ** 2).sum()) / pairs
        # A row of weight w is √w times as long.
        roots = weights.sqrt().repeat_interleave(len(r))
        system = (rows @ rows.T).double() * roots[:, None] * roots
        system.diagonal().add_(weight)
        progress(0.4)
        solution = _solve_positive_definite(system, roots * targets.reshape(-1), ridge)
        program = rows.double().T @ (roots * solution)
    else:
        # Element-wise binding makes the d × d matrix of all pairs a product of two small ones. It is a sum over the
        # conditions, which need not be held at once.
        covariance = torch.zeros(vsa.dim, vsa.dim, dtype=torch.float64, device=r.device)
        moment, squares = (torch.zeros(vsa.dim, dtype=torch.float64, device=r.device) for _ in range(2))
        done = 0
        for part in conditions.split(_ROWS):
            c, here = as_bipolar(part).to(kind), slice(done, done + len(part))
            weighted = weights[here, None].to(kind) * c
            covariance += (c.T @ weighted).double()
            moment += (weighted.double() * (targets[here] @ r.double())).sum(0)
            squares += (c.double() ** 2).sum(0)
            done += len(part)
            progress(0.4 * done / len(conditions))
        system = covariance.mul_((r.T @ r).double())
        system.diagonal().add_(ridge * float(squares @ (r.double() ** 2).sum(0)) / pairs)
        program = _solve_positive_definite(system, moment, ridge)
    progress(1.0)
    program = program.to(torch.float64 if vsa.dtype == torch.float64 else torch.float32)
    if not program.isfinite().all():
        raise ValueError(f"ridge={ridge:g} leaves no finite solution; take one nearer to 1")
    return program


def check_ridge(ridge: Any) -> float:
    """The weight of the squared length of the program as a float. Raises `ValueError` unless it is above 0."""
    return as_float("ridge", ridge, 0, above=True)


def _solve_positive_definite(
    system: Float64[Tensor, "n n"], target: Float64[Tensor, "n"], ridge: float
) -> Float64[Tensor, "n"]:
    """Solve a system that is positive definite, unless rounding has lost the ridge."""
    factor, failed = torch.linalg.cholesky_ex(system)
    if failed:
        raise ValueError(f"ridge={ridge:g} is too small: the system cannot be solved in float64; take a larger one")
    return torch.cholesky_solve(target[:, None], factor)[:, 0]
