"""Train a program by gradient descent on its recall errors."""

from dataclasses import dataclass
from typing import Literal, get_args

import torch
from jaxtyping import Float64
from torch import Tensor

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning.base import Rule, continued
from behaviours.learning.convergence import FEW, warn_if_wrong
from behaviours.learning.descent import Descent
from behaviours.learning.samples import Contradictions, Samples, check_contradictions
from behaviours.memory import require_levels
from behaviours.options import as_bool, as_float, as_int, set_fields
from behaviours.progress import Progress, no_progress, subrange
from behaviours.space import Space

Loss = Literal["cross_entropy", "hinge", "squared"]
Output = Literal["float", "bipolar", "int8"]


@dataclass(frozen=True)
class Gradient(Rule):
    """Train the program with Adam on a loss of the scores that recall compares.

    The score of a result is `<unbind(program, condition), result> / |result|`; giving no answer scores 0.

    | `loss` | of one sample |
    |---|---|
    | `cross_entropy` | -log of the softmax of all scores, including the 0 of no answer, at the target |
    | `hinge` | the squared hinge loss, summed over all other scores, including the 0 of no answer; the margin is 1 |
    | `squared` | the squared distance of the scores from 1 for the target and 0 for the others |

    Gradients are means over `batch_size` samples; the learning rate falls from `learning_rate` to 0 along a cosine.
    The result is the mean program of the last 30 % of the `epochs`. With `validation_fraction`, that share of the
    conditions is not trained on: the result is the program that recalls the most of them, and training stops after
    `patience` epochs without a better one.

    `sparse` writes the program as the difference of two squares and trains their roots. It represents the same
    programs, but few elements grow large, as under an L1 penalty. Use it where most dimensions carry no information,
    as with a threshold per dimension.

    `contradictions` decides about a condition shown with several results: `"all"` trains on every sample as shown,
    `"first"`, `"majority"` or `"latest"` on one result.

    `output` trains a program of -1 / +1 (`"bipolar"`) or of integers from -127 to 127 (`"int8"`) with
    straight-through gradients. All programs are float tensors. Every architecture is supported.

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
        set_fields(
            self,
            epochs=as_int("epochs", self.epochs, 1),
            batch_size=as_int("batch_size", self.batch_size, 1),
            learning_rate=as_float("learning_rate", self.learning_rate, 0, above=True, below=_MAX_LEARNING_RATE),
            sparse=as_bool("sparse", self.sparse),
            validation_fraction=as_float("validation_fraction", self.validation_fraction, 0, below=1),
            patience=as_int("patience", self.patience, 1),
            seed=as_int("seed", self.seed, *_SEEDS),
        )

    def fit(
        self,
        space: Space,
        demonstrations: Demonstrations,
        progress: Progress = no_progress,
        weights: Float64[Tensor, "N"] | None = None,
    ) -> Behaviour:
        """Learn a behaviour, see `Rule.fit`.

        `weights`, one positive number per row of the demonstrations, multiply the losses of the samples; only their
        ratios matter. They do not decide between contradicting samples: use them with `contradictions="all"`.

        Raises `ValueError` if `validation_fraction` leaves no condition to train on or none to validate with, if the
        program becomes infinite, and for weights that are not positive.
        """
        return self._learn(space, demonstrations, None, progress, weights)

    def partial_fit(
        self,
        behaviour: Behaviour,
        demonstrations: Demonstrations,
        progress: Progress = no_progress,
        weights: Float64[Tensor, "N"] | None = None,
    ) -> Behaviour:
        """Train the program of `behaviour` further, with a new optimiser and schedule; see `Rule.partial_fit`.

        Earlier demonstrations are not trained on again and may be forgotten: take few epochs or a low learning rate.
        Raises `ValueError` unless `output` is `"float"`, since a rounded program cannot follow small steps.
        """
        require_levels("partial_fit", [behaviour])
        if self.output != "float":
            raise ValueError(
                f"output={self.output!r} rounds the program, so that small steps are lost; continue with output='float'"
            )
        return self._learn(behaviour.space, demonstrations, behaviour, progress, weights)

    def _learn(
        self,
        space: Space,
        demonstrations: Demonstrations,
        before: Behaviour | None,
        progress: Progress,
        weights: Tensor | None,
    ) -> Behaviour:
        # The caller may have disabled gradients, and tensors created in inference mode cannot have any.
        with torch.inference_mode(False), torch.enable_grad():
            shown = Samples.of(space, demonstrations, subrange(progress, 0, 0.1))
            return self._train(space, shown.weighted(weights), before, progress)

    def _train(self, space: Space, shown: Samples, before: Behaviour | None, progress: Progress) -> Behaviour:
        if before is not None:
            shown = shown.with_known_results(before.results)
        targets = shown.targets("first" if self.contradictions == "all" else self.contradictions)
        samples = shown if self.contradictions == "all" else shown.resolved(self.contradictions)
        items = space.items(samples.results)
        generator = torch.Generator().manual_seed(self.seed)
        train, validation = self._split(samples, generator)
        descent = Descent(self, space.vsa, samples, items, before)
        program, epochs, updates = descent.run(train, validation, generator, subrange(progress, 0.1, 1))
        if not program.isfinite().all():
            raise ValueError(f"learning_rate={self.learning_rate:g} made the program infinite; take a lower one")
        predicted = descent.predict(program)
        progress(1.0)
        report = samples.report(
            self.name,
            contradicting=int((targets[shown.condition] != shown.result).sum()),
            epochs=epochs,
            updates=updates,
            wrong=int((predicted[samples.condition] != samples.result).sum()),
        )
        # Only conditions that were trained on can be wrong.
        trained = samples.condition[train].unique()
        warn_if_wrong(
            type(self).__name__,
            int(samples.missed(predicted)[trained].sum()),
            len(trained),
            contradicting=report.contradicting,
            samples=report.samples,
            after=f" after {epochs} epochs",
            remedy="more dimensions (dim), more epochs or another learning_rate",
            tolerated=FEW,
        )
        return continued(before, Behaviour(space, program, samples.condition_sum(space.vsa), samples.results, report))

    def _split(self, samples: Samples, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """The samples to train on, and those to validate with; all samples of a condition are in the same set."""
        count = round(self.validation_fraction * len(samples.conditions))
        if self.validation_fraction and not 0 < count < len(samples.conditions):
            raise ValueError(
                f"validation_fraction={self.validation_fraction} of {len(samples.conditions)} conditions leaves none "
                f"to {'train on' if count else 'validate with'}; give more conditions or another fraction"
            )
        chosen = torch.zeros(len(samples.conditions), dtype=torch.bool)
        chosen[torch.randperm(len(chosen), generator=generator)[:count]] = True
        validation = chosen[samples.condition.cpu()]
        return (~validation).nonzero()[:, 0], validation.nonzero()[:, 0]


_SEEDS = -(2**63), 2**64 - 1
"""The seeds that `torch.Generator` accepts."""

_MAX_LEARNING_RATE = 1e30
"""Larger Adam steps overflow float32."""
