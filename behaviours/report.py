"""What a learning rule did with demonstrations, in numbers and in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from behaviours.options import as_int, set_fields


@dataclass(frozen=True)
class LearningReport:
    """Counts of samples by what the rule did with them.

    Raises `ValueError` unless `rule` is a string and every count a whole number of at least 0.
    """

    rule: str
    samples: int
    new: int
    """Samples whose condition was stored for the first time."""
    truly_known: int = 0
    """Samples skipped because their condition was stored before."""
    falsely_known: int = 0
    """Samples skipped although their condition was never stored."""
    re_added: int = 0
    """Samples stored again, because `known` no longer resembled their condition."""
    contradicting: int = 0
    """Samples whose condition was stored before with another result."""
    epochs: int = 1
    """Passes over the pairs."""
    updates: int = 0
    """Corrections of a trained program, or steps of the optimiser."""
    wrong: int = 0
    """Pairs that a trained program recalls wrongly, or below the margin of the rule."""
    presumed_known: int = 0
    """Samples skipped because they resembled earlier demonstrations; whether correctly is unknown."""
    terms: tuple[str, ...] = ()
    """The terms of a sum of behaviours, such as `("seek", "2 * avoid")`."""

    def __post_init__(self) -> None:
        if not isinstance(self.rule, str):
            raise ValueError(f"the rule of a report is a string; got {self.rule!r}")
        if isinstance(self.terms, str) or not all(isinstance(term, str) for term in self.terms):
            raise ValueError(f"the terms of a report are strings; got {self.terms!r}")
        counts = {name: as_int(name, value, 0) for name, value in self._counts().items()}
        set_fields(self, **counts, terms=tuple(self.terms))

    def _counts(self) -> dict[str, int]:
        return {name: value for name, value in vars(self).items() if name not in ("rule", "terms")}

    @property
    def pairs(self) -> int:
        """The number of (condition, result) pairs added to the program, including repetitions."""
        return self.new + self.re_added

    def merged(self, later: "LearningReport") -> "LearningReport":
        """The report of this and later demonstrations: counts are added, but `wrong` is that of `later` alone."""
        counts: dict[str, Any] = {key: value + getattr(later, key) for key, value in self._counts().items()}
        counts["wrong"] = later.wrong
        return LearningReport(later.rule, **counts)

    def to_dict(self) -> dict[str, Any]:
        """The report as plain values, for a file; without `terms` if there are none."""
        return {"rule": self.rule, **self._counts()} | ({"terms": list(self.terms)} if self.terms else {})


def name_list(what: str, parts: Sequence[Any], most: int = 6) -> str:
    """The number of sensors or actuators, and the names of the first few."""
    names = ", ".join(part.name for part in parts[:most]) + (", ..." if len(parts) > most else "")
    return f"{len(parts)} {what} ({names})"
