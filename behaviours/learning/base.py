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
    """A learning rule turns demonstrations into a behaviour.

    A new rule is a subclass, registered in `behaviours.learning.RULES`.
    """

    name: ClassVar[str]
    integer_programs: ClassVar[bool] = True
    """Whether programs are sums of pairs: integers where the codes are integers. Otherwise they are floats."""

    supports_partial_fit: ClassVar[bool] = False
    """Whether `partial_fit` works, at least with some options of the rule."""

    supports_silence: ClassVar[bool] = False
    """Whether `fit_beside` works."""

    @classmethod
    def supports(cls, vsa: VSA) -> bool:
        """Whether the rule can train programs of this architecture."""
        return True

    @abstractmethod
    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> "Behaviour":
        """Learn a behaviour from demonstrations.

        Args:
            space: The codebooks that encode readings and commands.
            demonstrations: Readings and the commands that answer them.
            progress: Called with the completed fraction of the work, see `behaviours.progress`.

        Rules that train emit `ConvergenceWarning` if the program recalls some conditions wrongly. For a condition shown
        with several results, the result that it was trained on is right, or any of its most frequent results.

        Raises:
            ValueError: For readings or commands that are not valid.
        """

    def fit_beside(
        self, space: Space, demonstrations: Demonstrations, silent: Demonstrations, progress: Progress = no_progress
    ) -> "Behaviour":
        """Learn a behaviour that has no opinion where others have one.

        Args:
            space: As in `fit`.
            demonstrations: As in `fit`.
            silent: What the others were shown. Only its readings are used, never its commands: where they are not among
                the demonstrated conditions, every result is to score about 0, also those that only others have (as long
                as there are at most 64 combinations of levels).
            progress: As in `fit`.

        Raises:
            ValueError: If the rule cannot keep silence.
        """
        raise ValueError(f"{self.name!r} cannot keep silence; take ErrorDriven or LeastSquares")

    def partial_fit(
        self, behaviour: "Behaviour", demonstrations: Demonstrations, progress: Progress = no_progress
    ) -> "Behaviour":
        """Learn further demonstrations, starting from a behaviour.

        Args:
            behaviour: The behaviour to start from, learned by any rule; it is not changed. Its program, known
                conditions and clean-up memory are all that is used of earlier demonstrations.
            demonstrations: The further demonstrations. New results are appended to the memory in order of first
                appearance. Contradictions are resolved, and conditions are counted as new, within these demonstrations.
            progress: As in `fit`; so is `ConvergenceWarning`, for these demonstrations alone.

        Raises:
            ValueError: If the rule, or one of its options, cannot start from a behaviour.
        """
        raise ValueError(f"{self.name!r} cannot continue from a behaviour; give all demonstrations at once, to fit")


def continued(before: "Behaviour | None", behaviour: "Behaviour") -> "Behaviour":
    """Add the known conditions and the report of the previous behaviour to `behaviour`, and return it."""
    if before is not None:
        behaviour.known = behaviour.known + as_bipolar(before.known)
        behaviour.report = before.report.merged(behaviour.report)
    return behaviour
