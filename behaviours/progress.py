"""How long work tells how far it is."""

from collections.abc import Callable

Progress = Callable[[float], object]
"""Called with the share of the work that is done, from 0 to 1, now and then and at its end."""


def no_progress(share: float) -> None:
    """Tell nobody."""


def subrange(progress: Progress, low: float, high: float) -> Progress:
    """The progress of a part of the work, which takes it from `low` to `high`."""
    return lambda share: progress(low + (high - low) * share)
