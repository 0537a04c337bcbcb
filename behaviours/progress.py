"""Progress callbacks."""

from collections.abc import Callable

Progress = Callable[[float], object]
"""Called with the completed fraction of the work, from 0 to 1, at intervals and at the end."""


def no_progress(fraction: float) -> None:
    """Ignore progress."""


def subrange(progress: Progress, low: float, high: float) -> Progress:
    """A callback for a part of the work: maps its fractions to the range from `low` to `high` of `progress`."""
    return lambda fraction: progress(low + (high - low) * fraction)


def in_steps(progress: Progress, steps: int) -> Progress:
    """A callback that calls `progress` once for each completed step of so many, so that it can print."""
    told = -1

    def show(fraction: float) -> None:
        nonlocal told
        # The sum of a few fractions may be a little less than the step.
        step = int(steps * fraction + 1e-9)
        if step > told:
            told = step
            progress(fraction)

    return show
