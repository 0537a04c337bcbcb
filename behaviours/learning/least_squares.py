"""The program whose answers come closest to what they shall be."""

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float, Float64, Shaped
from torch import Tensor

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule
from behaviours.learning.convergence import FEW, warn_if_wrong
from behaviours.learning.samples import Contradictions, Samples, check_contradictions
from behaviours.options import number, store
from behaviours.progress import Progress, no_progress, subrange
from behaviours.space import Space
from torchvsa import VSA
from torchvsa._numerics import as_bipolar, is_integer


@dataclass(frozen=True)
class LeastSquares(Rule):
    """Answer each condition with 1 for its own result and 0 for every other one, as nearly as possible.

    A condition shown with several results shall answer with the share of each (`contradictions="all"`), or with
    the `"first"`, the `"majority"` or the `"latest"` of them alone. `ridge` keeps the program short: it is the
    weight of its squared length, in units of the squared length of one stored pair.

    The closed form needs a bind that acts on every dimension by itself, and real numbers; `fit` raises
    `ValueError` for other architectures. The program is a float vector.

    Source: ridge regression, Hoerl and Kennard 1970.
    """

    name = "least_squares"
    integer_programs = False

    ridge: float = 1e-3
    contradictions: Contradictions | Literal["all"] = "all"

    def __post_init__(self) -> None:
        check_contradictions(self.contradictions, "all")
        store(self, ridge=number("ridge", self.ridge, 0, above=True))

    @classmethod
    def supports(cls, vsa: VSA) -> bool:
        """See `Rule.supports`: element-wise binding of real numbers."""
        return vsa.elementwise and not vsa.dtype.is_complex

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        """See `Rule.fit`."""
        shown = Samples.of(space, demonstrations, subrange(progress, 0, 0.2))
        samples = shown if self.contradictions == "all" else shown.resolved(self.contradictions)
        shape = len(samples.conditions), len(samples.results)
        cells = samples.condition * shape[1] + samples.result
        counts = torch.bincount(cells, minlength=shape[0] * shape[1]).view(shape).to(torch.float64)
        items = space.items(samples.results)
        targets = counts / counts.sum(1, keepdim=True)
        conditions = samples.conditions[:]
        program = solve(space.vsa, conditions, items, targets, self.ridge, subrange(progress, 0.2, 0.9))
        said = space.vsa.readout(program, items)(conditions).argmax(1)
        report = samples.report(
            self.name,
            contradicting=int((counts.argmax(1)[shown.condition] != shown.result).sum()),
            wrong=int((said != counts.argmax(1)).sum()),
        )
        progress(1.0)
        warn_if_wrong(
            type(self).__name__,
            int(samples.missed(said).sum()),
            len(counts),
            contradicting=report.contradicting,
            samples=report.samples,
            after="",
            remedy="more dimensions (dim) or a smaller ridge",
            tolerated=FEW,
        )
        return Behaviour(space, program, samples.known(space.vsa), samples.results, report)

    def partial_fit(
        self, behaviour: Behaviour, demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        """Raises `ValueError`: the solution alone cannot go on."""
        raise ValueError(
            "least squares cannot go on from a program: a further pair also needs the inverse covariance of all pairs "
            "before it, d by d numbers that no behaviour keeps; show all demonstrations at once, to fit, or go on with "
            "ErrorDriven or Gradient"
        )


def solve(
    vsa: VSA,
    conditions: Shaped[Tensor, "k d"],
    items: Shaped[Tensor, "r d"],
    targets: Float64[Tensor, "k r"],
    ridge: float,
    progress: Progress = no_progress,
) -> Float[Tensor, "d"]:
    """The program p that minimises the sum over k and r of (<c_k ⊗ r_r, p> - target)² plus `ridge` times s·|p|².

    `s` is the mean squared length of a pair c ⊗ r. With k·r pairs the system has k·r unknowns in the dual and d in the
    primal form, and the smaller one is solved, in float64. `progress` is called with the share of the work that is
    done.

    Raises `ValueError` for architectures without element-wise binding of real numbers, and for a `ridge` that is not
    above 0, or too small to solve the system.
    """
    ridge = number("ridge", ridge, 0, above=True)
    if not LeastSquares.supports(vsa):
        raise ValueError(
            f"least squares needs a bind of real numbers, element by element, which {vsa.name} lacks; "
            "train it with ErrorDriven or Gradient"
        )
    # Sums of fewer than 2^24 products of -1 and +1 are exact in float32, and twice as fast.
    exact = is_integer(conditions) and is_integer(items)
    c, r = (as_bipolar(x).to(torch.float32 if exact else torch.float64) for x in (conditions, items))
    pairs = len(c) * len(r)
    weight = ridge * float((c.double() ** 2).sum(0) @ (r.double() ** 2).sum(0)) / pairs
    if pairs <= vsa.dim:
        rows = (c[:, None] * r).flatten(0, 1)
        system = (rows @ rows.T).double()
        system.diagonal().add_(weight)
        progress(0.4)
        program = rows.double().T @ _positive(system, targets.reshape(-1), ridge)
    else:
        # Element-wise binding makes the d × d matrix of all pairs a product of two small ones.
        system = ((c.T @ c) * (r.T @ r)).double()
        system.diagonal().add_(weight)
        progress(0.4)
        program = _positive(system, (c.double() * (targets @ r.double())).sum(0), ridge)
    progress(1.0)
    return program.to(torch.float64 if vsa.dtype == torch.float64 else torch.float32)


def _positive(system: Float64[Tensor, "n n"], target: Float64[Tensor, "n"], ridge: float) -> Float64[Tensor, "n"]:
    """Solve a system that is positive definite unless the ridge is lost in rounding."""
    factor, failed = torch.linalg.cholesky_ex(system)
    if failed:
        raise ValueError(f"ridge={ridge:g} is too small: the system cannot be solved in float64; take a larger one")
    return torch.cholesky_solve(target[:, None], factor)[:, 0]
