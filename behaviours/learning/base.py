"""The interface of learning rules."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from behaviours.demonstrations import Demonstrations
from behaviours.progress import Progress, no_progress
from behaviours.space import Space
from torchvsa import VSA
from torchvsa._numerics import as_bipolar

if TYPE_CHECKING:
    from behaviours.behaviour import Behaviour


class Rule(ABC):
    """Turns a demonstration into a behaviour. A new rule is one class, registered in `behaviours.learning.RULES`."""

    name: ClassVar[str]
    integer_programs: ClassVar[bool] = True
    """Whether programs are sums of pairs, integers for integer codes; else they are always floats."""

    supports_partial_fit: ClassVar[bool] = False
    """Whether it can go on from a behaviour with some of its options, see `partial_fit`."""

    @classmethod
    def supports(cls, vsa: VSA) -> bool:
        """Whether the rule can train programs of this architecture."""
        return True

    @abstractmethod
    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> "Behaviour":
        """Learn one program from the demonstration. Raises for readings or commands that are not valid.

        `progress` is called with the share of the work that is done, see `behaviours.progress`. Rules that train warn
        with `ConvergenceWarning` if the program recalls some conditions wrongly; of a condition that was shown with
        several results only the one that it was trained to counts, or any of the most frequent ones.
        """

    def partial_fit(
        self, behaviour: "Behaviour", demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> "Behaviour":
        """Go on learning: what becomes of `behaviour`, whichever rule it is from, when this is shown as well.

        Of earlier demonstrations only the behaviour is left: its program, known conditions and clean-up memory. New
        results are appended to the memory in order of first insertion. Contradictions are settled within the piece,
        and the report counts a condition as new in each piece that stores it. `behaviour` itself stays as it is.
        `progress` and `ConvergenceWarning`, which looks at this piece alone, are as in `fit`.

        Raises `ValueError` where a rule, or an option of it, needs more than that.
        """
        raise ValueError(f"{self.name!r} cannot go on from a behaviour; show all demonstrations at once, to fit")


def continued(before: "Behaviour | None", piece: "Behaviour") -> "Behaviour":
    """`piece`, whose known conditions and report take in those of the behaviour `before` it."""
    if before is not None:
        piece.known = piece.known + as_bipolar(before.known)
        piece.report = before.report.merged(piece.report)
    return piece
