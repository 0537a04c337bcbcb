"""Installed packages for tests: what pip leaves in `site-packages`, written by hand, and Python started with it."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]


def install(site: Path, package: str, modules: Mapping[str, str], plugins: Mapping[str, str]) -> None:
    """Put modules (name -> code) into `site` as a package with these entry points of `torchvsa.plugins`."""
    for name, code in modules.items():
        site.joinpath(f"{name}.py").write_text(code)
    info = site / f"{package.replace('-', '_')}-1.0.dist-info"
    info.mkdir()
    info.joinpath("METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    lines = [f"{name} = {value}\n" for name, value in plugins.items()]
    info.joinpath("entry_points.txt").write_text("[torchvsa.plugins]\n" + "".join(lines))


def python(site: Path | None, code: str, *options: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run code in a process of its own that finds this project and, if given, the packages in `site`."""
    folders = [str(folder) for folder in (site, ROOT) if folder is not None]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(folders), "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, *options, "-c", code], env=environment, cwd=cwd, capture_output=True, text=True, check=False
    )
