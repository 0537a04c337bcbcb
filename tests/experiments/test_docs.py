"""What README and docs say about studies is true."""

import json
import re
import tomllib
from pathlib import Path

import pytest
from kits import composed
from packages import ROOT, install, python

from experiments import studies
from experiments.main import COMMANDS

DOCS = ROOT / "docs"
TINY = ("starts=4", "other_starts=4", "wheeled_starts=4", "demonstrations=4", "seconds=8", "workers=1", "animate=false")


@pytest.mark.slow
def test_a_sweep_of_the_main_job_is_collected(tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / "sweeps.md").read_text(), re.DOTALL)
    (block,) = [block for block in blocks if "read_parquet" in block]
    sweep = ["corral", "--multirun", "vsa.dim=400,900", "controllers=[teacher,default]", *TINY]
    calls = f"from experiments.main import main; main({sweep}); main(['collect', 'outputs/corral/sweep'])"
    ran = python(None, f"{calls}\n{block}", "-W", "error", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    shown = ran.stdout[ran.stdout.index("config.vsa.dim  controller") :]
    assert re.findall(r"(default|teacher) +[\d.]+$", shown, re.MULTILINE) == ["default", "teacher"] * 2


def test_the_settings_of_its_commands_are_settings() -> None:
    pages = "".join((DOCS / f"{page}.md").read_text() for page in ("running", "sweeps"))
    commands = re.findall(r"^torchvsa (\w+) (.*?)(?: +#.*)?$", pages, re.MULTILINE)
    assert len(commands) > 2
    for name, overrides in commands:
        words = [word for word in overrides.split() if "=" in word and not word.startswith("hydra")]
        if name not in COMMANDS and "--config-dir" not in overrides:
            composed(studies.find(name), *(word.split(",")[0] for word in words))


@pytest.mark.slow
def test_the_study_and_the_arena_of_the_documentation_work(tmp_path: Path) -> None:
    text = (DOCS / "studies.md").read_text()
    study, arena = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    project = tomllib.loads(re.findall(r"```toml\n(.*?)```", text, re.DOTALL)[0])["project"]
    site = tmp_path / "site"
    site.mkdir()
    modules = {"bundling": study, "hall": arena}
    install(site, project["name"], modules, project["entry-points"]["torchvsa.plugins"])
    command = "from experiments.main import main; main({!r})"
    sweep = ["bundling", "--multirun", "experiment=quick", "seed=0,1", "workers=1"]
    calls = "; ".join(map(command.format, (sweep, ["corral", "--help"], ["bundling", "summands=[2000]"])))
    ran = python(site, calls, "-W", "error", cwd=tmp_path)
    assert ran.stderr == "bundling: summands=2000: expected at most items=1000\n"
    assert "hall" in ran.stdout
    results = [json.loads(path.read_text()) for path in sorted(tmp_path.rglob("results.json"))]
    assert [content["config"]["seed"] for content in results] == [0, 1]
    assert min(content["metrics"]["250.5.recognised"] for content in results) > 0.9
