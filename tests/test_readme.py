"""What the README says is true."""

import re
import subprocess
import sys
from pathlib import Path

import torch

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


FIRST, KINDS, PAPER, CLASSIFIER, SUMS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_first_lines_are_few_run_and_answer() -> None:
    assert len([line for line in FIRST.splitlines() if line.strip()]) <= 10
    code = FIRST + "\nassert recall.commands.tolist() == [[1.0], [-1.0]], recall\n"
    code += "assert 'program' in steer.state_dict() and steer.program.shape == (4000,)\n"
    assert "program" in run(code)


def test_a_robot_with_sensors_of_all_kinds_drives_across_the_seam() -> None:
    assert float(run(KINDS)) == 1


def test_the_parts_of_the_paper_are_made() -> None:
    assert "SelfShift" in run(PAPER)


def test_the_classifier_scores_what_one_would_hope() -> None:
    assert float(run(CLASSIFIER)) > 0.99


def test_behaviours_add_up() -> None:
    assert "sum of seek, 2 * avoid" in run(SUMS)


def test_the_files_that_it_names_are_there() -> None:
    for link in re.findall(r"\]\(((?!http)[^)]+)\)", README) + re.findall(r"`((?:\w+/)+[\w./]*)`", README):
        if not link.startswith("outputs/"):
            assert (ROOT / link).exists(), link


def test_the_commands_are_targets_of_make() -> None:
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"^make (\w+)", README, re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_the_version_is_said_once() -> None:
    import torchvsa

    assert f'version = "{torchvsa.__version__}"' in (ROOT / "pyproject.toml").read_text()
    assert torch.__version__.split("+")[0] == "2.13.0"
