"""The training loop of `Gradient`: parameters, loss and optimiser steps of one fit."""

import math
from typing import TYPE_CHECKING

import torch
from jaxtyping import Float, Int64, Shaped
from torch import Tensor
from torch.nn import functional

from behaviours.behaviour import Behaviour
from behaviours.learning.samples import Samples
from behaviours.progress import Progress
from torchvsa import VSA
from torchvsa._numerics import as_bipolar

if TYPE_CHECKING:
    from behaviours.learning.gradient import Gradient


class Descent:
    """The trained parameters of one fit, and the program that they define."""

    def __init__(
        self,
        rule: "Gradient",
        vsa: VSA,
        samples: Samples,
        items: Shaped[Tensor, "r d"],
        before: Behaviour | None = None,
    ) -> None:
        self.rule, self.vsa, self.samples, self.items = rule, vsa, samples, items
        dtype = torch.float32 if vsa.integer else vsa.dtype
        self.complex = dtype.is_complex
        zero = torch.zeros(vsa.dim, dtype=dtype, device=items.device)
        self.readout = vsa.readout(zero, items)
        program = zero if before is None else as_bipolar(before.program).detach().to(dtype, copy=True)
        start = torch.view_as_real(program) if self.complex else program
        if rule.sparse:
            # Two equal roots give a program of 0. At exactly 0 they would have no gradient.
            roots = torch.full((2, *start.shape), _ROOT, dtype=start.dtype, device=items.device)
            start = roots if before is None else (torch.stack([start, -start]).clamp(min=0) + roots**2).sqrt()
        self.parameters = start.requires_grad_()

    def floats(self) -> Float[Tensor, "..."]:
        """The program before rounding; complex programs as pairs of real numbers."""
        if not self.rule.sparse:
            return self.parameters
        # x·|x| instead of x² keeps the sign of the gradient right for roots below 0.
        positive, negative = self.parameters * self.parameters.abs()
        return positive - negative

    def program(self, floats: Float[Tensor, "..."], *, scaled: bool = True) -> Shaped[Tensor, "d"]:
        """The program rounded as `output` says; `scaled` keeps the size of `floats`, as in training."""
        rounded = floats
        if self.rule.output != "float":
            size = floats.detach().abs()
            if self.rule.output == "bipolar":
                step, codes = size.mean(), torch.where(floats >= 0, 1.0, -1.0).to(floats)
            else:
                step = size.max() / 127
                codes = (floats.detach() / step.clamp(min=torch.finfo(floats.dtype).tiny)).round()
            # Straight-through: rounded in the forward pass, the identity in the backward pass.
            rounded = floats + (codes * step - floats).detach() if scaled else codes
        return torch.view_as_complex(rounded) if self.complex else rounded

    def sample_scores(self, program: Shaped[Tensor, "d"], rows: Int64[Tensor, "batch"]) -> Float[Tensor, "batch r"]:
        """The score of each result for these samples."""
        return self._condition_scores(program, self.samples.condition[rows])

    def _condition_scores(
        self, program: Shaped[Tensor, "d"], indices: Int64[Tensor, "batch"]
    ) -> Float[Tensor, "batch r"]:
        """The score of each result for these conditions."""
        # index_select copies whole rows far faster than indexing does.
        conditions = self.samples.conditions.index_select(0, indices)
        return self.readout.of(program)(conditions)

    def loss(self, rows: Int64[Tensor, "batch"]) -> Float[Tensor, ""]:
        """The mean loss of these samples."""
        scores = self.sample_scores(self.program(self.floats()), rows)
        targets = self.samples.result[rows]
        losses = self._losses(scores, targets)
        if self.samples.weights is not None:
            losses = losses * self.samples.weights[rows]
        return losses.mean()

    def _losses(self, scores: Float[Tensor, "batch r"], targets: Int64[Tensor, "batch"]) -> Float[Tensor, "batch"]:
        if self.rule.loss == "squared":
            return ((scores - functional.one_hot(targets, scores.shape[1])) ** 2).sum(1)
        # A last column of 0: the score of no answer.
        scores = functional.pad(scores, (0, 1))
        if self.rule.loss == "cross_entropy":
            return functional.cross_entropy(scores, targets, reduction="none")
        violation = (1 - scores.gather(1, targets[:, None]) + scores).clamp(min=0)
        return (violation.scatter(1, targets[:, None], 0) ** 2).sum(1)

    @torch.no_grad()
    def count_wrong(self, program: Shaped[Tensor, "d"], rows: Int64[Tensor, "N"]) -> float:
        """The number (with weights, the weight) of the samples that another result than theirs wins."""
        weights = self.samples.weights
        wrong = 0.0
        for part in rows.split(_ROWS):
            missed = self.sample_scores(program, part).argmax(1) != self.samples.result[part]
            wrong += float(missed.sum() if weights is None else weights[part][missed].sum())
        return wrong

    @torch.no_grad()
    def predict(self, program: Shaped[Tensor, "d"]) -> Int64[Tensor, "k"]:
        """The index of the result that scores highest, for each condition."""
        indices = torch.arange(len(self.samples.conditions), device=self.items.device)
        # One preallocated tensor: many small ones between large temporary ones would fragment the memory.
        predicted = torch.empty_like(indices)
        for part, into in zip(indices.split(_ROWS), predicted.split(_ROWS), strict=True):
            into.copy_(self._condition_scores(program, part).argmax(1))
        return predicted

    def run(
        self, train: Tensor, validation: Tensor, generator: torch.Generator, progress: Progress
    ) -> tuple[Tensor, int, int]:
        """Train on the samples `train`, and choose the program by the samples `validation`, if there are any.

        Returns the program, the number of epochs and the number of optimiser steps.
        """
        rule = self.rule
        optimiser = torch.optim.Adam([self.parameters], lr=rule.learning_rate)
        steps_per_epoch = math.ceil(len(train) / rule.batch_size)
        steps = steps_per_epoch * rule.epochs
        best, best_wrong, best_epoch = self.floats().detach().clone(), math.inf, 0
        total, averaged = torch.zeros_like(best, dtype=torch.float64), 0
        step = epoch = 0
        for epoch in range(1, rule.epochs + 1):
            order = train[torch.randperm(len(train), generator=generator)]
            for rows in order.tensor_split(steps_per_epoch):
                for group in optimiser.param_groups:
                    group["lr"] = rule.learning_rate * (1 + math.cos(math.pi * step / steps)) / 2
                optimiser.zero_grad()
                self.loss(rows).backward()
                optimiser.step()
                if rule.sparse:
                    with torch.no_grad():
                        self.parameters.clamp_(min=_MIN_ROOT)
                step += 1
                if step % _STEPS_PER_REPORT == 0:
                    progress(step / steps)
            progress(epoch / rule.epochs)
            current = self.floats().detach()
            if not len(validation):
                if epoch > rule.epochs - max(round(0.3 * rule.epochs), 1):
                    total, averaged = total + current, averaged + 1
                continue
            wrong = self.count_wrong(self.program(current), validation)
            if wrong < best_wrong:
                best, best_wrong, best_epoch = current.clone(), wrong, epoch
            elif epoch - best_epoch >= rule.patience:
                break
        chosen = best if len(validation) else (total / averaged).to(best.dtype)
        return self.program(chosen, scaled=False), epoch, step


_ROWS = 1024
"""Rows scored in one call; bounds the memory."""

_STEPS_PER_REPORT = 64
"""Steps between two calls of `progress` within an epoch."""

_ROOT = 0.1
"""The initial roots of a sparse program: 0.01 as a program, small compared with trained ones."""

_MIN_ROOT = 1e-4
"""Roots stay at or above it, so that an element can grow again."""
