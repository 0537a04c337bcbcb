"""Run the real commands as a user would, in a folder outside the checkout."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from experiments.main import main

SMALL = (
    "demonstrations=6", "starts=6", "other_starts=4", "wheeled_starts=2", "validation_starts=2", "seconds=20",
    "vsa.dim=1000",
)  # fmt: skip
"""A job of seconds instead of minutes; what it shows is not meant to be good."""


def output_of(folder: Path, study: str, *overrides: str) -> str:
    """What the command of a study prints in `folder`; it must not fail."""
    command = [sys.executable, "-m", "experiments", study, *overrides]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=500)
    assert run.returncode == 0, run.stderr
    return run.stdout


def only(folder: Path, name: str) -> Path:
    """The one file of that name below a folder."""
    (path,) = folder.rglob(name)
    return path


def drawn_again(page: Path) -> str:
    """The text of a run's page after `torchvsa draw`, which writes it anew."""
    page.unlink()
    main(["draw", str(page.parent)])
    return page.read_text()


def results(folder: Path) -> dict[str, Any]:
    """The one `results.json` below a folder."""
    return json.loads(only(folder, "results.json").read_text())


def without_timings(content: dict[str, Any], *settings: str) -> dict[str, Any]:
    """The same without what may differ from run to run, and without these settings."""
    table = [{key: value for key, value in row.items() if key != "query_us"} for row in content["table"]]
    metrics = {key: value for key, value in content["metrics"].items() if not key.endswith("query_us")}
    config = {key: value for key, value in content["config"].items() if key not in settings}
    return content | {"table": table, "metrics": metrics, "config": config, "wall_time_s": 0}
