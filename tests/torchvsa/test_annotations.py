"""The shapes in the signatures are true: the law suite passes with every annotation checked at run time."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_the_law_suite_passes_with_checked_shapes() -> None:
    suite = Path(__file__).with_name("test_laws.py")
    checked = "--jaxtyping-packages=torchvsa,beartype.beartype"
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", checked, suite]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
