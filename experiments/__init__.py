"""Reproducible studies, one file per question. The only place where robot and algebra meet."""

import sys
from pathlib import Path

from experiments.installation import problem

if (_found := problem()) is not None:
    if Path(sys.argv[0]).name in ("torchvsa", "torchvsa-corral"):  # commands say it in one line
        sys.exit(f"torchvsa: {_found}")
    raise _found
