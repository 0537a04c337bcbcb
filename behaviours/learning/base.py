"""The interface of learning rules."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from behaviours.demonstrations import Demonstrations
from behaviours.space import Space
from torchvsa import VSA

if TYPE_CHECKING:
    from behaviours.behaviour import Behaviour


class Rule(ABC):
    """Turns a demonstration into a behaviour. A new rule is one class, listed in `behaviours.learning.RULES`."""

    name: ClassVar[str]
    counts: ClassVar[bool] = True
    """Whether programs are sums of pairs, integers for integer codes; else they are always floats."""

    @classmethod
    def supports(cls, vsa: VSA) -> bool:
        """Whether the rule can train programs of this architecture."""
        return True

    @abstractmethod
    def fit(self, space: Space, demonstrations: Demonstrations) -> "Behaviour":
        """Learn one program from the demonstration. Raises for readings or commands that are not valid."""
