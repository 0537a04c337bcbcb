"""`check_rule` names the law that a broken learning rule breaks."""

from dataclasses import dataclass, field, replace
from typing import Any

import pytest
import torch
from torch import Tensor

from behaviours import Behaviour, Demonstrations, ErrorDriven, LeastSquares, OneShot
from behaviours.progress import Progress, no_progress
from behaviours.space import Space
from behaviours.testing import check_rule
from torchvsa import VSA


class Miscounting(OneShot):
    """Reports a sample too many."""

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        behaviour = super().fit(space, demonstrations, progress)
        behaviour.report = replace(behaviour.report, samples=behaviour.report.samples + 1)
        return behaviour


class Random(OneShot):
    """Adds noise from PyTorch's global generator."""

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        behaviour = super().fit(space, demonstrations, progress)
        behaviour.program.add_(torch.randint_like(behaviour.program, 2))
        return behaviour


class Seeding(OneShot):
    """Seeds PyTorch's global generator."""

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        torch.manual_seed(0)
        return super().fit(space, demonstrations, progress)


@dataclass(frozen=True)
class Remembering(OneShot):
    """Sums up all that it was ever shown."""

    name = "remembering"
    past: list[Tensor] = field(default_factory=list, repr=False)

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        behaviour = super().fit(space, demonstrations, progress)
        self.past.append(behaviour.program.clone())
        behaviour.program = torch.stack(self.past).sum(0, dtype=torch.int32)
        return behaviour


class Forgetful(OneShot):
    """Learns the first half alone."""

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        half = torch.arange(len(demonstrations)) <= len(demonstrations) // 2
        return super().fit(space, demonstrations.where(half), progress)


class Greedy(OneShot):
    """Writes into the demonstration."""

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        behaviour = super().fit(space, demonstrations, progress)
        demonstrations.commands.neg_()
        return behaviour


class Hasty(OneShot):
    """Never says that it is done."""

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        return super().fit(space, demonstrations, lambda share: progress(share / 2))


class Overwriting(ErrorDriven):
    """Goes on within the behaviour that it was given."""

    def partial_fit(
        self, behaviour: Behaviour, demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        after = super().partial_fit(behaviour, demonstrations, progress)
        behaviour.program.copy_(after.program)
        return after


class Crashing(OneShot):
    """Cannot go on, and says so in its own way."""

    def partial_fit(
        self, behaviour: Behaviour, demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> Behaviour:
        raise NotImplementedError("not today")


class Undifferentiable(OneShot):
    """Learns nothing where gradients are off."""

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        behaviour = super().fit(space, demonstrations, progress)
        behaviour.program *= int(torch.is_grad_enabled())
        return behaviour


class Careless(OneShot):
    """Takes rows in which nothing was observed, and leaves them out."""

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        return super().fit(space, demonstrations.where(~demonstrations.sensors.isnan().all(1)), progress)


class Unwilling(LeastSquares):
    """Learns with an architecture that it says it does not support."""

    @classmethod
    def supports(cls, vsa: VSA) -> bool:
        return False


@pytest.mark.parametrize(
    ("rule", "law"),
    [
        (Miscounting(), "the report adds up|a behaviour over the given space is learned"),
        (Random(), "a behaviour over the given space is learned|fitting again gives the same bits"),
        (Seeding(), "fitting again gives the same bits. AssertionError: PyTorch's global random numbers"),
        (Remembering(), "a behaviour over the given space is learned|fitting again gives the same bits"),
        (Forgetful(), "unrelated pairs are recalled"),
        (Greedy(), "demonstrations space and rule are not changed|unrelated pairs are recalled"),
        (Hasty(), "progress rises to one"),
        (Overwriting(), "partial fit continues or raises value error.*program of the behaviour before was changed"),
        (
            Crashing(),
            "(progress rises to one|partial fit continues or raises value error). NotImplementedError: not today",
        ),
        (Undifferentiable(), "whether gradients are on does not matter"),
        (Careless(), "invalid demonstrations raise value error"),
        (Unwilling(), "unsupported architectures raise value error. AssertionError: no ValueError was raised"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, OneShot | ErrorDriven | LeastSquares) else "",
)
def test_a_broken_rule_is_told_its_law(rule: Any, law: str) -> None:
    with pytest.raises(AssertionError, match=rf"{type(rule).__name__}\(.* breaks the law: ({law})"):
        check_rule(rule)


def test_a_rule_is_an_object() -> None:
    with pytest.raises(TypeError, match=r"write OneShot\(\)"):
        check_rule(OneShot)  # type: ignore[arg-type] (refused)
