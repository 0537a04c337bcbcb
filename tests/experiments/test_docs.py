"""What README and docs say about studies is true."""

import io
import re
import tomllib
from pathlib import Path

import pandas as pd
import pytest
from kits import composed
from packages import ROOT, install, python

from experiments import studies
from experiments.kit.run import config_of
from experiments.kit.store import write_results
from experiments.main import COMMANDS

README = (ROOT / "README.md").read_text()
COLLECT = re.findall(r"```python\n(.*?)```", README, re.DOTALL)[-1]


def test_a_sweep_of_the_main_job_is_collected(tmp_path: Path) -> None:
    corral = studies.find("corral")
    assert corral.objective is not None
    for dim, success in ((1000, 0.25), (4000, 0.75)):
        settings = composed(corral, f"vsa.dim={dim}")
        content = {"config": config_of(settings), "metrics": {corral.objective: success}}
        folder = tmp_path / "outputs" / "corral" / "sweep" / f"vsa.dim={dim}"
        folder.mkdir(parents=True)
        write_results(folder / "results.json", content)
    collected = python(None, COLLECT, "-W", "error", cwd=tmp_path)
    assert collected.returncode == 0, collected.stderr
    printed = pd.read_csv(io.StringIO(collected.stdout), sep=r"\s+")
    assert printed.to_numpy().tolist() == [[1000, 0, 0.25], [4000, 0, 0.75]]


def test_the_settings_of_its_commands_are_settings() -> None:
    commands = re.findall(r"^torchvsa (\w+) (.*?)(?: +#.*)?$", README, re.MULTILINE)
    assert len(commands) > 2
    for name, overrides in commands:
        words = [word for word in overrides.split() if "=" in word and not word.startswith("hydra")]
        if name not in COMMANDS and "--config-dir" not in overrides:
            composed(studies.find(name), *(word.split(",")[0] for word in words))


@pytest.mark.slow
def test_the_study_and_the_arena_of_the_documentation_work(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "studies.md").read_text()
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
    collect = COLLECT.replace("corral", "bundling").replace("default.success_rate", "250.5.recognised")
    printed = python(None, collect, "-W", "error", cwd=tmp_path)
    frame = pd.read_csv(io.StringIO(printed.stdout), sep=r"\s+")
    assert frame["config.seed"].tolist() == [0, 1], printed.stderr
    assert min(frame["metrics.250.5.recognised"].tolist()) > 0.9
