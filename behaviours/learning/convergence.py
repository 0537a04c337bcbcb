"""The warning of rules whose trained program recalls pairs wrongly."""

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_MANY = 0.05
"""The warning names contradicting rows from this share on; fewer hardly explain the wrong pairs."""
FEW = 0.05
"""The share of wrong pairs below which approximate rules do not warn, since data are usually noisy."""


class ConvergenceWarning(UserWarning):
    """A trained program recalls some pairs wrongly."""


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
    """Warn if the program recalls `wrong` of its `pairs` wrongly. The warning points at the calling line of the user.

    Args:
        rule: The class name of the rule.
        wrong: The number of conditions that recall another result than they were trained on.
        pairs: The number of conditions that were trained on.
        contradicting: The number of samples that show another result than their condition was trained on.
        samples: The number of all samples.
        after: How long the program was trained, for the message.
        remedy: What helps if (nearly) no samples contradict each other, for the message.
        tolerated: The share of wrong pairs that causes no warning.
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
    """Ignore `ConvergenceWarning`, for callers that report wrong pairs themselves. A context manager and decorator."""
    with warnings.catch_warnings(action="ignore", category=ConvergenceWarning):
        yield


def _frames_inside() -> int:
    """The `stacklevel`, as seen from the caller of this function, of the first frame outside this package."""
    package = __name__.partition(".")[0]
    frame: FrameType | None = sys._getframe(1)
    level = 1
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == package:
        frame, level = frame.f_back, level + 1
    return level
