"""Learn a program in closed form, by ridge regression."""

from dataclasses import dataclass
from typing import Literal

import torch
from torch.nn import functional

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule
from behaviours.learning.convergence import FEW, warn_if_wrong
from behaviours.learning.ridge import EXACT, ROWS, check_ridge, chosen_ridge, has_ridge, solve
from behaviours.learning.samples import Contradictions, Samples, check_contradictions
from behaviours.options import as_bool, as_float, set_fields
from behaviours.progress import Progress, no_progress, subrange
from behaviours.space import Space
from torchvsa import VSA
from torchvsa._numerics import norms


@dataclass(frozen=True)
class LeastSquares(Rule):
    """Ridge regression for the program: the target score of a condition is 1 for its result and 0 for all others.

    For a condition shown with several results the targets are the share of each (`contradictions="all"`), or 1 for the
    `"first"`, the `"majority"` or the `"latest"` alone. `ridge` is the weight of the squared length of the program, in
    units of the squared length of one stored pair; None is 1e-3, and for smooth commands the one of `RIDGES` with the
    smallest error on a fifth of the conditions that is held out: noise needs more, exact demonstrations less.

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

    ridge: float | None = None
    contradictions: Contradictions | Literal["all"] = "all"
    evidence: float = 0.0
    smooth: bool = False

    def __post_init__(self) -> None:
        check_contradictions(self.contradictions, "all")
        set_fields(
            self,
            ridge=None if self.ridge is None else check_ridge(self.ridge),
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
        return has_ridge(vsa)

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        """Learn a behaviour, see `Rule.fit`.

        Raises `ValueError` for an architecture that is not supported, and for a `ridge` with which the system has no
        solution in floats.
        """
        return self._fit(space, demonstrations, None, progress)

    def fit_beside(
        self, space: Space, demonstrations: Demonstrations, silent: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        """Learn a behaviour that is silent where others have an opinion, see `Rule.fit_beside`."""
        return self._fit(space, demonstrations, silent, progress)

    def _fit(
        self, space: Space, demonstrations: Demonstrations, silent: Demonstrations | None, progress: Progress
    ) -> Behaviour:
        shown = Samples.of(space, demonstrations, subrange(progress, 0, 0.2), silent)
        if self.smooth:
            return self._learn_smooth(space, shown, demonstrations, progress)
        return self._learn(space, shown, progress)

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
        roles = space.result_encoder.roles
        # Scores are divided by the lengths of the roles.
        wanted, weights = targets * norms(roles), counts
        if samples.silent is not None:
            fitted = torch.cat([conditions[:], samples.silent[:]])
            wanted = functional.pad(wanted, (0, 0, 0, len(samples.silent)))
            weights = functional.pad(counts, (0, len(samples.silent)), value=1.0)
        ridge = self.ridge
        if ridge is None:
            generator = torch.Generator().manual_seed(space.seed)
            ridge = chosen_ridge(space.vsa, fitted, roles, wanted, weights, generator)
        program = solve(space.vsa, fitted, roles, wanted, ridge, weights, subrange(progress, 0.2, 0.9))
        readout = space.vsa.readout(program, roles)
        commanded = torch.cat([readout(rows).clamp(-1, 1) for rows in conditions.split(ROWS)])
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
        ridge = EXACT if self.ridge is None else self.ridge
        program = solve(space.vsa, fitted, every, targets, ridge, progress=subrange(progress, 0.2, 0.9))
        readout = space.vsa.readout(program, items)
        predicted = torch.cat([readout(rows).argmax(1) for rows in conditions.split(ROWS)])
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
