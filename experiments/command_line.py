"""How a study behaves as a command."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from hydra.errors import HydraException
from omegaconf.errors import OmegaConfBaseException

TRACEBACK_WANTED = os.environ.get("HYDRA_FULL_ERROR") == "1"
"""Whether the user asked Hydra for whole tracebacks, read before this module sets the same variable."""


@contextmanager
def errors_in_one_line(name: str) -> Iterator[None]:
    """What the user can mend is told in one line on stderr, with exit status 1.

    With HYDRA_FULL_ERROR=1 in the environment the whole traceback is shown instead.
    """
    os.environ["HYDRA_FULL_ERROR"] = "1"  # makes Hydra raise, instead of printing a report of several lines itself
    try:
        yield
    except (HydraException, OmegaConfBaseException, ValueError, TypeError, OSError) as error:
        if TRACEBACK_WANTED:
            raise
        print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(1)
