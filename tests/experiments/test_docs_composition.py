"""The policy, the behaviour and the arena of docs/composition.md, installed and run as they are written there."""

import json
import re
import shlex
import tomllib
from pathlib import Path

import pytest
from packages import ROOT, install, python


@pytest.mark.slow
def test_a_policy_a_behaviour_and_an_arena_of_ones_own(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "composition.md").read_text()
    text = text[text.index("## A policy, a behaviour and an arena of your own") :]
    codes = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    project = tomllib.loads(re.findall(r"```toml\n(.*?)```", text, re.DOTALL)[0])
    names = project["tool"]["setuptools"]["py-modules"]
    install(
        tmp_path, project["project"]["name"], dict(zip(names, codes, strict=True)),
        project["project"]["entry-points"]["torchvsa.plugins"],
    )  # fmt: skip
    command, *arguments = shlex.split(re.findall(r"```bash\n(.*?)```", text, re.DOTALL)[0])
    assert command == "torchvsa"
    small = ("starts=4", "other_starts=4", "heldout=2", "codebooks=1", "demonstrations=6", "vsa.dim=512", "seconds=8")
    ran = python(
        tmp_path,
        f"from experiments.main import main; main({[*arguments, *small, 'workers=1', 'hydra.run.dir=out']})",
        cwd=tmp_path,
    )
    assert ran.returncode == 0, ran.stderr
    rows = {
        (row["row"], row["arena"]): row for row in json.loads((tmp_path / "out" / "results.json").read_text())["table"]
    }
    assert {name for name, _ in rows} == {"teacher", "joint_program", "surest", "evident_sum"}
    assert {arena for _, arena in rows} == {"pillar", "large"}
    assert rows["teacher", "pillar"]["agreement"] == 1.0
    assert rows["evident_sum", "pillar"]["agreement"] > 0.8
    assert (tmp_path / "out" / "figures" / "animation_surest.gif").is_file()
