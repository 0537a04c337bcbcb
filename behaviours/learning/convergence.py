"""A warning for training that leaves pairs wrong."""

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_MANY = 0.05
"""The share of contradicting rows from which on they are named; fewer hardly explain what is wrong."""
FEW = 0.05
"""The share of pairs that rules which fit approximately may leave wrong without a word: noise in the data is usual."""


class ConvergenceWarning(UserWarning):
    """A rule was trained, and the program still recalls some pairs wrongly."""


def warn_if_wrong(
    rule: str,
    wrong: int,
    pairs: int,
    *,
    contradicting: int,
    samples: int,
    after: str,
    remedy: str,
    tolerated: float = 0.0,
) -> None:
    """Warn if the program recalls `wrong` of its `pairs` wrongly, pointing at the line outside of this package.

    Args:
        rule: the name of its class.
        wrong: the conditions that recall another result than the one that they were trained to.
        pairs: the conditions that it was trained on.
        contradicting: the samples that show another result than the one that their condition was trained to.
        samples: all samples.
        after: how long it was trained, for the message.
        remedy: what helps where (nearly) nothing contradicts.
        tolerated: the share of pairs that may be wrong without a warning.
    """
    if wrong <= tolerated * pairs:
        return
    if contradicting >= _MANY * samples:
        cause = (
            f"{contradicting} of {samples} rows ({contradicting / samples:.0%}) contradict the others (same condition, "
            f"other commands): take more bins or fewer levels, or {remedy}"
        )
    else:
        cause = f"take {remedy}"
    message = f"{rule} left {wrong} of {pairs} pairs wrong{after}; {cause}"
    warnings.warn(message, ConvergenceWarning, stacklevel=_frames_inside())


@contextmanager
def no_convergence_warnings() -> Iterator[None]:
    """Ignore `ConvergenceWarning`, for callers who report themselves what is wrong. A decorator as well."""
    with warnings.catch_warnings(action="ignore", category=ConvergenceWarning):
        yield


def _frames_inside() -> int:
    """The `stacklevel`, for the caller of this function, of the first frame outside of this package."""
    package = __name__.partition(".")[0]
    frame: FrameType | None = sys._getframe(1)
    level = 1
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == package:
        frame, level = frame.f_back, level + 1
    return level
