"""The interface of learning rules."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from behaviours.demonstrations import Demonstrations
from behaviours.space import Space

if TYPE_CHECKING:
    from behaviours.behaviour import Behaviour


class Rule(ABC):
    """Turns a demonstration into a behaviour. A new rule is one class, listed in `behaviours.learning.RULES`."""

    name: ClassVar[str]

    @abstractmethod
    def fit(self, space: Space, demonstrations: Demonstrations) -> "Behaviour":
        """Learn one program from the demonstration. Raises for readings or commands that are not valid."""
