"""What the README says is true."""

import contextlib
import io
import json
import re
import tomllib
from pathlib import Path

import pytest
import torch
from packages import ROOT, python

import torchvsa

README = (ROOT / "README.md").read_text()

FIRST, SAVE, ALGEBRA = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def run(code: str) -> str:
    """What code prints that begins anew in this process, whose tests take warnings for errors."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "README.md", "exec"), {"__name__": "__main__"})
    return printed.getvalue()


def test_the_first_lines_are_few_run_and_answer() -> None:
    assert len([line for line in FIRST.splitlines() if line.strip()]) <= 10
    code = FIRST + "\nassert recall.commands.tolist() == [[1.0], [-1.0]], recall\n"
    code += "assert 'program' in steer.state_dict() and steer.program.shape == (4000,)\n"
    # In a process of its own, as a user runs it.
    done = python(None, code, "-W", "error")
    assert done.returncode == 0, done.stderr
    assert "program" in done.stdout


def test_a_saved_bank_holds_the_behaviour(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    save, load, load_state = SAVE.splitlines()
    same = "torch.equal(again(readings).commands, steer(readings).commands)"
    code = [FIRST, save, load, f"assert {same}", "again.program.zero_()", f"assert not {same}", load_state]
    run("\n".join([*code, f"assert {same}"]))


def test_the_algebra_finds_the_colour_of_the_ball() -> None:
    similarities, index = run(ALGEBRA).splitlines()
    red, blue = json.loads(similarities.removeprefix("tensor(").removesuffix(")"))
    assert red == pytest.approx(0.5**0.5, abs=0.03)
    assert abs(blue) < 0.08
    assert index == "tensor(3)"


def test_the_files_that_it_names_are_there() -> None:
    for link in re.findall(r"\]\(((?!http)[^)]+)\)", README) + re.findall(r"`((?:\w+/)+[\w./]*)`", README):
        if not link.startswith("outputs/"):
            path, _, part = link.partition("#")
            assert (ROOT / path).exists(), link
            headings = re.findall(r"^#+ (.*)$", (ROOT / path).read_text(), re.MULTILINE) if part else []
            anchors = {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}
            assert not part or part in anchors, link


def test_the_commands_are_targets_of_make() -> None:
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"\bmake (\w+)", "\n".join(re.findall(r"`[^`]*`|^make .*$", README, re.MULTILINE))):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_the_extras_are_those_of_the_package() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    table = (ROOT / "docs" / "install.md").read_text().split("| extra | for |")[1].split("\n\n")[0]
    assert set(re.findall(r"^\| `(\w+)`", table, re.MULTILINE)) == set(extras) - {"dev"}


def test_the_version_is_said_once() -> None:
    assert f'version = "{torchvsa.__version__}"' in (ROOT / "pyproject.toml").read_text()
    assert torch.__version__.split("+")[0] == "2.13.0"
    assert "torch==2.13.0" in README
    assert "\ntorch==2.13.0\n" in (ROOT / "constraints.txt").read_text()
