"""A learning rule on trial."""

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
"""Few enough for every architecture to hold in one program of 1,000 dimensions."""


@dataclass(frozen=True)
class Trial:
    """A rule, and the codebooks over which it learns."""

    rule: Rule
    space: Space

    def __repr__(self) -> str:
        return repr(self.rule)

    def shown(self, seed: int = 0) -> Demonstrations:
        """A few unrelated pairs."""
        return pairs(self.space, _PAIRS, seed)

    def fit(self, shown: Demonstrations | None = None) -> Behaviour:
        """What the rule learns from `shown`, by default from the pairs above."""
        return self.rule.fit(self.space, self.shown() if shown is None else shown)

    def goes_on(self, before: Behaviour, shown: Demonstrations) -> Behaviour | None:
        """What becomes of a behaviour, or None if the rule raises `ValueError`."""
        try:
            return self.rule.partial_fit(before, shown)
        except ValueError:
            return None


def same_program(a: Behaviour, b: Behaviour) -> None:
    """Raise `AssertionError` unless both hold the same bits, and the same report."""
    for name in ("program", "known", "results"):
        same(bits(getattr(a, name)), bits(getattr(b, name)))
    require(a.report == b.report, f"the reports differ: {a.report} and {b.report}")


def rows(shown: Demonstrations, numbers: Sequence[int]) -> Demonstrations:
    """These rows, which may repeat, each as an episode of its own."""
    which = torch.tensor(list(numbers))
    return Demonstrations(shown.sensors[which], shown.commands[which], torch.arange(len(which)))


def counted(report: LearningReport) -> int:
    """The samples, by what became of them."""
    return report.new + report.re_added + report.truly_known + report.falsely_known + report.presumed_known
