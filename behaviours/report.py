"""What a learning rule did with a demonstration."""

from dataclasses import dataclass
from typing import Any

from behaviours.options import store, whole


@dataclass(frozen=True)
class LearningReport:
    """Counts of the samples of one demonstration, by what the rule decided about them.

    Raises `ValueError` unless `rule` is a string and every count a whole number from 0 on.
    """

    rule: str
    samples: int
    new: int
    """Samples whose condition was stored for the first time."""
    truly_known: int = 0
    """Samples taken as known whose condition was stored before."""
    falsely_known: int = 0
    """Samples taken as known although their condition was never stored: lost to the program."""
    re_added: int = 0
    """Samples stored once more, since the memory had forgotten their condition."""
    contradicting: int = 0
    """Samples whose condition was stored before with another result."""
    epochs: int = 1
    """How often the rule went through the pairs."""
    updates: int = 0
    """How often a trained program was corrected."""
    wrong: int = 0
    """Pairs that a trained program still recalls wrongly, or below the margin asked for."""
    presumed_known: int = 0
    """Samples taken as known for their likeness to earlier pieces: truly or falsely, nobody remembers."""
    terms: tuple[str, ...] = ()
    """Of a sum of behaviours, what it is made of: `("seek", "2 * avoid")`."""

    def __post_init__(self) -> None:
        if not isinstance(self.rule, str):
            raise ValueError(f"the rule of a report is the name of one; got {self.rule!r}")
        if isinstance(self.terms, str) or not all(isinstance(term, str) for term in self.terms):
            raise ValueError(f"the terms of a report are a tuple of texts; got {self.terms!r}")
        counts = {name: whole(name, value, 0) for name, value in self._counts().items()}
        store(self, **counts, terms=tuple(self.terms))

    def _counts(self) -> dict[str, int]:
        return {name: value for name, value in vars(self).items() if name not in ("rule", "terms")}

    @property
    def pairs(self) -> int:
        """Pairs of condition and result added to the program, repetitions included."""
        return self.new + self.re_added

    def merged(self, later: "LearningReport") -> "LearningReport":
        """The report of two pieces of demonstration: counts add up; `wrong` is known of the later one only."""
        counts: dict[str, Any] = {key: value + getattr(later, key) for key, value in self._counts().items()}
        counts["wrong"] = later.wrong
        return LearningReport(later.rule, **counts)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for a file; `terms` only where there are some."""
        return {"rule": self.rule, **self._counts()} | ({"terms": list(self.terms)} if self.terms else {})
