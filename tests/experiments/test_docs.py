"""What README and docs say about studies is true."""

import io
import re
from pathlib import Path

import pandas as pd
from kits import composed
from packages import ROOT, python

from experiments.kit import STUDIES
from experiments.kit.run import config_of
from experiments.kit.store import write_results

README = (ROOT / "README.md").read_text()
COLLECT = re.findall(r"```python\n(.*?)```", README, re.DOTALL)[-1]


def test_a_sweep_of_the_main_job_is_collected(tmp_path: Path) -> None:
    corral = STUDIES["corral"]
    assert corral.objective is not None
    for dim, success in ((1000, 0.25), (4000, 0.75)):
        settings = corral.settings(vsa={"name": "MAP-C", "dim": dim})
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
        if name != "draw" and "--config-dir" not in overrides:
            composed(STUDIES[name], *(word.split(",")[0] for word in words))
