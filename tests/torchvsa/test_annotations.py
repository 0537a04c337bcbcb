"""The shapes in the signatures are true: the law suites pass with every annotation checked at run time."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
@pytest.mark.parametrize("suite", ["test_laws.py", "encoders/test_encoder_laws.py", "encoders/test_records.py"])
def test_the_law_suites_pass_with_checked_shapes(suite: str) -> None:
    path = Path(__file__).parent / suite
    checked = "--jaxtyping-packages=torchvsa,beartype.beartype"
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", checked, path]
    run = subprocess.run([*command, "-m", "not slow"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
