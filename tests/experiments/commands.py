"""Run the real commands as a user would type them, in a folder outside the checkout."""

import contextlib
import fcntl
import io
import json
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any
from unittest.mock import patch

from experiments.main import main


def output_of(folder: Path, study: str, *overrides: str) -> str:
    """What the command of a study prints in `folder`; it must not fail.

    It runs in this process, which has imported already what a process of its own would import anew. That the command
    starts by itself is for `test_packaging` and `test_kit_command`.
    """
    printed = io.StringIO()
    with contextlib.chdir(folder), patch.object(sys, "argv", ["torchvsa"]), contextlib.redirect_stdout(printed):
        main([study, *overrides])
    return printed.getvalue()


def shared_output_of(folder: Path, study: str, *overrides: str) -> str:
    """The same of a run that all processes of the tests share: the first to need it makes it, each gets a copy."""
    of_tests = os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid()))
    made = Path(tempfile.gettempdir(), f"torchvsa-tests-{of_tests}-{study}")
    with made.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        printed = made / "printed.txt"
        if not printed.exists():
            made.mkdir()
            printed.write_text(output_of(made, study, *overrides))
    shutil.copytree(made / "outputs", folder / "outputs")
    return printed.read_text()


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
