"""The behaviours know only the floor below them."""

import subprocess
import sys


def test_importing_behaviours_brings_in_neither_robot_nor_experiments() -> None:
    """In a fresh interpreter: what this one has loaded says nothing."""
    strangers = ["sim", "experiments", "pybullet", "hydra", "gymnasium", "sklearn"]
    code = f"import sys, behaviours; print([m for m in {strangers} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
