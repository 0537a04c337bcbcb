"""Gradient descent on the mistakes of recall."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import torch
from jaxtyping import Float, Int64, Shaped
from torch import Tensor
from torch.nn import functional

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule, continued
from behaviours.learning.convergence import FEW, warn_if_wrong
from behaviours.learning.samples import Contradictions, Samples, check_contradictions
from behaviours.options import flag, number, store, whole
from behaviours.progress import Progress, no_progress, subrange
from behaviours.space import Space
from torchvsa import VSA
from torchvsa._numerics import as_bipolar

Loss = Literal["cross_entropy", "hinge", "squared"]
Output = Literal["float", "bipolar", "int8"]


@dataclass(frozen=True)
class Gradient(Rule):
    """Follow the gradient of a loss of the scores that recall compares, in small batches of samples.

    The score of a result is `<unbind(program, condition), result> / |result|`, silence has the score 0.

    | `loss` | of one sample |
    |---|---|
    | `cross_entropy` | -log of the softmax of the scores (silence among them) at the own result |
    | `hinge` | the sum of the squares by which the own result leads any other, or silence, by less than 1 |
    | `squared` | the squared distance of the scores from 1 for the own result and 0 for the others |

    Adam with a cosine schedule goes `epochs` times through the samples and, without `validation_fraction`, answers with
    the mean program of the last three tenths. With `validation_fraction`, a share of the conditions is kept out of
    training; the program that recalled most of them is the answer, and training stops after `patience` epochs
    without a better one.

    `sparse` writes the program as the difference of two squares and descends on their roots: the same
    programs, but few elements grow large, as under a penalty on absolute values. Use it where most dimensions have no
    say, as with a threshold per dimension.

    Every sample has its say where contradictory ones share a condition (`contradictions="all"`); else all of them
    show the `"first"`, the `"majority"` or the `"latest"` result.

    `output` trains a program of -1 / +1 (`"bipolar"`) or of integers from -127 to 127 (`"int8"`) with
    straight-through gradients. All programs are floats in type; any architecture can be trained.

    Source: Adam, Kingma and Ba 2015; straight-through, Bengio et al. 2013; difference of squares as
    sparsity, Vaškevičius et al. 2019; trained class vectors, e.g. LeHDC, Duan et al. 2022.
    """

    name = "gradient"
    integer_programs = False
    supports_partial_fit = True

    loss: Loss = "cross_entropy"
    epochs: int = 60
    batch_size: int = 128
    learning_rate: float = 0.05
    sparse: bool = False
    validation_fraction: float = 0.0
    patience: int = 10
    output: Output = "float"
    seed: int = 0
    contradictions: Contradictions | Literal["all"] = "all"

    def __post_init__(self) -> None:
        check_contradictions(self.contradictions, "all")
        for field, options in (("loss", Loss), ("output", Output)):
            if getattr(self, field) not in get_args(options):
                raise ValueError(f"{field} is one of {', '.join(get_args(options))}; got {getattr(self, field)!r}")
        store(
            self,
            epochs=whole("epochs", self.epochs, 1),
            batch_size=whole("batch_size", self.batch_size, 1),
            learning_rate=number("learning_rate", self.learning_rate, 0, above=True, below=_FASTEST),
            sparse=flag("sparse", self.sparse),
            validation_fraction=number("validation_fraction", self.validation_fraction, 0, below=1),
            patience=whole("patience", self.patience, 1),
            seed=whole("seed", self.seed, *_SEEDS),
        )

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        """See `Rule.fit`. Raises `ValueError` if the share held back leaves no condition on one of both sides."""
        return self._learn(space, demonstrations, None, progress)

    def partial_fit(
        self, behaviour: Behaviour, demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        """See `Rule.partial_fit`: descend from the program at hand, with a new optimiser and a new schedule.

        Nothing holds an earlier piece in place but the program's own inertia: take few epochs or a low learning rate.
        Raises `ValueError` unless `output` is `"float"`, since a rounded program cannot follow small steps.
        """
        if self.output != "float":
            raise ValueError(
                f"a program rounded to {self.output!r} no longer holds what small steps add up to; go on with "
                "output='float'"
            )
        return self._learn(behaviour.space, demonstrations, behaviour, progress)

    def _learn(
        self, space: Space, demonstrations: Demonstrations, before: Behaviour | None, progress: Progress
    ) -> Behaviour:
        # Callers may have turned gradients off, and tensors made in inference mode could not take part in any.
        with torch.inference_mode(False), torch.enable_grad():
            return self._descend(space, demonstrations, before, progress)

    def _descend(
        self, space: Space, demonstrations: Demonstrations, before: Behaviour | None, progress: Progress
    ) -> Behaviour:
        shown = Samples.of(space, demonstrations, subrange(progress, 0, 0.1))
        if before is not None:
            shown = shown.with_known_results(before.results)
        aims = shown.targets("first" if self.contradictions == "all" else self.contradictions)
        samples = shown if self.contradictions == "all" else shown.resolved(self.contradictions)
        items = space.items(samples.results)
        generator = torch.Generator().manual_seed(self.seed)
        train, held = self._split(samples, generator)
        training = _Training(self, space.vsa, samples, items, before)
        program, epochs, updates = training.run(train, held, generator, subrange(progress, 0.1, 1))
        if not program.isfinite().all():
            raise ValueError(f"learning_rate={self.learning_rate:g} drove the program to infinity; take a lower one")
        answers = training.answers(program)
        progress(1.0)
        report = samples.report(
            self.name,
            contradicting=int((aims[shown.condition] != shown.result).sum()),
            epochs=epochs,
            updates=updates,
            wrong=int((answers[samples.condition] != samples.result).sum()),
        )
        # Conditions held back were not trained on.
        trained = samples.condition[train].unique()
        warn_if_wrong(
            type(self).__name__,
            int(samples.missed(answers)[trained].sum()),
            len(trained),
            contradicting=report.contradicting,
            samples=report.samples,
            after=f" after {epochs} epochs",
            remedy="more dimensions (dim), more epochs or another learning_rate",
            tolerated=FEW,
        )
        return continued(before, Behaviour(space, program, samples.known(space.vsa), samples.results, report))

    def _split(self, samples: Samples, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """The samples to train on and those held back: all of a condition on the same side."""
        count = round(self.validation_fraction * len(samples.conditions))
        if self.validation_fraction and not 0 < count < len(samples.conditions):
            raise ValueError(
                f"validation_fraction={self.validation_fraction} of {len(samples.conditions)} conditions leaves none "
                f"to {'train on' if count else 'hold back'}; give more conditions or another share"
            )
        away = torch.zeros(len(samples.conditions), dtype=torch.bool)
        away[torch.randperm(len(away), generator=generator)[:count]] = True
        held = away[samples.condition.cpu()]
        return (~held).nonzero()[:, 0], held.nonzero()[:, 0]


class _Training:
    """The parameters of one fit, and the program that they stand for."""

    def __init__(
        self,
        rule: Gradient,
        vsa: VSA,
        samples: Samples,
        items: Shaped[Tensor, "r d"],
        before: Behaviour | None = None,
    ) -> None:
        self.rule, self.vsa, self.samples, self.items = rule, vsa, samples, items
        wide = torch.float32 if vsa.integer else vsa.dtype
        self.complex = wide.is_complex
        zero = torch.zeros(vsa.dim, dtype=wide, device=items.device)
        self.readout = vsa.readout(zero, items)
        program = zero if before is None else as_bipolar(before.program).detach().to(wide, copy=True)
        start = torch.view_as_real(program) if self.complex else program
        if rule.sparse:
            # Two equal roots make a program of 0; at exactly 0 they would have no gradient.
            roots = torch.full((2, *start.shape), _ROOT, dtype=start.dtype, device=items.device)
            start = roots if before is None else (torch.stack([start, -start]).clamp(min=0) + roots**2).sqrt()
        self.parameters = start.requires_grad_()

    def floats(self) -> Float[Tensor, "..."]:
        """The program before it is rounded; complex ones as pairs of real numbers."""
        if not self.rule.sparse:
            return self.parameters
        # Roots are kept above 0 by their absolute value; x·|x| rather than x² keeps the gradient's sign right.
        grow, shrink = self.parameters * self.parameters.abs()
        return grow - shrink

    def program(self, floats: Float[Tensor, "..."], *, scaled: bool = True) -> Shaped[Tensor, "d"]:
        """The program as `output` rounds it, by default in the size at which it is trained."""
        rounded = floats
        if self.rule.output != "float":
            size = floats.detach().abs()
            if self.rule.output == "bipolar":
                step, codes = size.mean(), torch.where(floats >= 0, 1.0, -1.0).to(floats)
            else:
                step = size.max() / 127
                codes = (floats.detach() / step.clamp(min=torch.finfo(floats.dtype).tiny)).round()
            # Rounded on the way there, the identity on the way back.
            rounded = floats + (codes * step - floats).detach() if scaled else codes
        return torch.view_as_complex(rounded) if self.complex else rounded

    def scores(self, program: Shaped[Tensor, "d"], rows: Int64[Tensor, "batch"]) -> Float[Tensor, "batch r"]:
        """What recall compares, for samples."""
        return self._recall(program, self.samples.condition[rows])

    def _recall(self, program: Shaped[Tensor, "d"], which: Int64[Tensor, "batch"]) -> Float[Tensor, "batch r"]:
        """The same for conditions."""
        # Whole rows are copied far faster by index_select than by an index.
        conditions = self.samples.conditions.index_select(0, which)
        return self.readout.of(program)(conditions)

    def loss(self, rows: Int64[Tensor, "batch"]) -> Float[Tensor, ""]:
        """The mean loss of some samples."""
        answers = self.scores(self.program(self.floats()), rows)
        aims = self.samples.result[rows]
        if self.rule.loss == "squared":
            return ((answers - functional.one_hot(aims, answers.shape[1])) ** 2).sum(1).mean()
        answers = functional.pad(answers, (0, 1))
        if self.rule.loss == "cross_entropy":
            return functional.cross_entropy(answers, aims)
        short = (1 - answers.gather(1, aims[:, None]) + answers).clamp(min=0)
        return (short.scatter(1, aims[:, None], 0) ** 2).sum(1).mean()

    @torch.no_grad()
    def wrong(self, program: Shaped[Tensor, "d"], rows: Int64[Tensor, "N"]) -> int:
        """How many samples recall another result than their own."""
        parts = [self.scores(program, part).argmax(1) != self.samples.result[part] for part in rows.split(1024)]
        return sum(int(part.sum()) for part in parts)

    @torch.no_grad()
    def answers(self, program: Shaped[Tensor, "d"]) -> Int64[Tensor, "k"]:
        """The result that each condition recalls."""
        conditions = torch.arange(len(self.samples.conditions), device=self.items.device)
        return torch.cat([self._recall(program, part).argmax(1) for part in conditions.split(1024)])

    def run(
        self, train: Tensor, held: Tensor, generator: torch.Generator, progress: Progress
    ) -> tuple[Tensor, int, int]:
        """Descend; the program, the epochs and the number of steps."""
        rule = self.rule
        optimiser = torch.optim.Adam([self.parameters], lr=rule.learning_rate)
        steps_per_epoch = math.ceil(len(train) / rule.batch_size)
        best, best_wrong, best_epoch = self.floats().detach().clone(), len(held) + 1, 0
        total, averaged = torch.zeros_like(best, dtype=torch.float64), 0
        step = epoch = 0
        for epoch in range(1, rule.epochs + 1):
            order = train[torch.randperm(len(train), generator=generator)]
            for rows in order.tensor_split(steps_per_epoch):
                for group in optimiser.param_groups:
                    group["lr"] = (
                        rule.learning_rate * (1 + math.cos(math.pi * step / (steps_per_epoch * rule.epochs))) / 2
                    )
                optimiser.zero_grad()
                self.loss(rows).backward()
                optimiser.step()
                if rule.sparse:
                    with torch.no_grad():
                        self.parameters.clamp_(min=_FLOOR)
                step += 1
                if step % _TOLD == 0:
                    progress(step / (steps_per_epoch * rule.epochs))
            progress(epoch / rule.epochs)
            now = self.floats().detach()
            if not len(held):
                if epoch > rule.epochs - max(round(0.3 * rule.epochs), 1):
                    total, averaged = total + now, averaged + 1
                continue
            wrong = self.wrong(self.program(now), held)
            if wrong < best_wrong:
                best, best_wrong, best_epoch = now.clone(), wrong, epoch
            elif epoch - best_epoch >= rule.patience:
                break
        answer = best if len(held) else (total / averaged).to(best.dtype)
        return self.program(answer, scaled=False), epoch, step


_SEEDS = -(2**63), 2**64 - 1
"""What `torch.Generator` takes."""

_FASTEST = 1e30
"""Learning rates stay below it, since steps of more do not fit into float32."""

_TOLD = 64
"""Steps between two reports of progress within an epoch."""

_ROOT = 0.1
"""Where the roots of a sparse program start: programs of 0.01, small beside those learned."""

_FLOOR = 1e-4
"""Roots stay above it, so that an element can come back."""
