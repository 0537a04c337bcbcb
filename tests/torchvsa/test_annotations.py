"""The shapes in the signatures are true: the law suites pass with every annotation checked at run time."""

import subprocess
import sys
from pathlib import Path

import pytest

SUITES = ["test_laws.py", "encoders/test_encoder_laws.py", "encoders/test_records.py"]
CHOSEN = "test_laws.py or test_records.py or keep_the_laws"
SAME_CODE = "MAP-B or MAP-I or MAP-C-float32 or overflow or MBAT or MCR or VTB or BSDC"
"""Encoders in these run the lines that they run in MAP-C's integers or in HRR, with the same symbolic shapes."""
SAME_LAWS = "test_encoder_laws.py and (HRR-float32 or -HRR-None or BSC)"
"""What is not element-wise, or not a number, is bound and bundled in records, too."""


@pytest.mark.slow
def test_the_law_suites_pass_with_checked_shapes() -> None:
    paths = [Path(__file__).parent / suite for suite in SUITES]
    checked = "--jaxtyping-packages=torchvsa,beartype.beartype"
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", checked, *paths]
    chosen = f"test_laws.py or (({CHOSEN}) and not ({SAME_CODE}) and not ({SAME_LAWS}))"
    run = subprocess.run([*command, "-m", "not slow", "-k", chosen], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
