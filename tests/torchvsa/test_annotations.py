"""The shapes in the signatures are true: the law suites pass with every annotation checked at run time."""

import subprocess
import sys
from pathlib import Path

import pytest

ENCODERS = ["encoders/test_encoder_laws.py", "encoders/test_records.py"]
SAME_CODE = "MAP-B or MAP-I or odd_dimensions"
"""Encoders in these run the lines that they run in MAP-C, with the same symbolic shapes."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suites", "left_out"),
    [(["test_laws.py"], "nothing"), (ENCODERS[:1], SAME_CODE), (ENCODERS[1:], SAME_CODE)],
    ids=["algebra", "encoders", "records"],
)
def test_the_law_suites_pass_with_checked_shapes(suites: list[str], left_out: str) -> None:
    paths = [Path(__file__).parent / suite for suite in suites]
    checked = "--jaxtyping-packages=torchvsa,beartype.beartype"
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", checked, *paths]
    chosen = ["-m", "not slow", "-k", f"not ({left_out})"]
    run = subprocess.run([*command, *chosen], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
