"""Progress callbacks."""

from collections.abc import Callable

Progress = Callable[[float], object]
"""Called with the completed fraction of the work, from 0 to 1, at intervals and at the end."""


def no_progress(fraction: float) -> None:
    """Ignore progress."""


def subrange(progress: Progress, low: float, high: float) -> Progress:
    """A callback for a part of the work: maps its fractions to the range from `low` to `high` of `progress`."""
    return lambda fraction: progress(low + (high - low) * fraction)
