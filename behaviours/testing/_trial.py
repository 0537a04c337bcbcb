"""A learning rule under test."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning import Rule
from behaviours.report import LearningReport
from behaviours.space import Space
from behaviours.testing._material import bits, pairs
from torchvsa.testing._laws import require, same

_PAIRS = 8
"""A program of 1,000 dimensions can store so few pairs with every architecture."""


@dataclass(frozen=True)
class Trial:
    """A rule, and the space over which it learns."""

    rule: Rule
    space: Space

    def __repr__(self) -> str:
        return repr(self.rule)

    def shown(self, seed: int = 0) -> Demonstrations:
        """Demonstrations of a few unrelated pairs."""
        return pairs(self.space, _PAIRS, seed)

    def fit(self, shown: Demonstrations | None = None) -> Behaviour:
        """The behaviour that the rule learns from `shown`, by default from `self.shown()`."""
        return self.rule.fit(self.space, self.shown() if shown is None else shown)

    def try_partial_fit(self, before: Behaviour, shown: Demonstrations) -> Behaviour | None:
        """The behaviour after further demonstrations, or None if the rule raises `ValueError`."""
        try:
            return self.rule.partial_fit(before, shown)
        except ValueError:
            return None


def same_program(a: Behaviour, b: Behaviour) -> None:
    """Raise `AssertionError` unless both have the same tensors, bit for bit, and the same report."""
    for name in ("program", "known", "results"):
        same(bits(getattr(a, name)), bits(getattr(b, name)))
    require(a.report == b.report, f"the reports differ: {a.report} and {b.report}")


def rows(shown: Demonstrations, indices: Sequence[int]) -> Demonstrations:
    """The rows at these indices, which may repeat, each in its own episode."""
    index = torch.tensor(list(indices))
    return Demonstrations(shown.sensors[index], shown.commands[index], torch.arange(len(index)))


def count_samples(report: LearningReport) -> int:
    """The sum of the counts of a report that partition the samples."""
    return report.new + report.re_added + report.truly_known + report.falsely_known + report.presumed_known
