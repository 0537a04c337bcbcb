"""What `make release-check` does: builds the project, and installs and uses it as a stranger would.

Wheel and source distribution are built and checked. The wheel is then installed into an empty environment without
extras, and for each extra into a copy of that, and does the extra's job in an empty folder (see `jobs.py`); so does it
with other Pythons that are at hand. `--write` puts what was measured into `docs/install.md`.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

from distributions import build
from packages import ROOT

CONSTRAINTS = ROOT / "constraints.txt"
PAGE = ROOT / "docs" / "install.md"
JOBS = Path(__file__).with_name("jobs.py")
OTHER_PYTHONS = ("python3.12", "python3.13")
WITHOUT_PYBULLET = ("library", "sklearn", "vector", "studies")
"""What other Pythons must do, with the extra `corral`."""


@dataclass
class Installed:
    """An environment: what was asked for, its size, and how long it took to fill and to do its jobs."""

    python: str
    extra: str
    packages: int
    megabytes: int
    jobs: tuple[str, ...]
    seconds: float


def main() -> None:
    """Check everything, or the extras that are named; the exit status is 1 if anything fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("extras", nargs="*", help="check these extras only; by default all, and other Pythons")
    parser.add_argument("--python", action="append", help="another Python to check; by default those at hand")
    parser.add_argument("--write", action="store_true", help="write the sizes into docs/install.md")
    given = parser.parse_args()
    extras = [extra for extra in known_extras() if extra in given.extras or not given.extras]
    with tempfile.TemporaryDirectory(prefix="torchvsa-release-") as name:
        folder = Path(name)
        wheel, source = build(folder / "dist")
        run(sys.executable, "-m", "twine", "check", "--strict", wheel, source)
        print(f"{wheel.name} and {source.name}: built, and correct to twine", flush=True)
        found = [fresh(folder / "plain", sys.executable, wheel, "", ("library", "without_studies"))]
        for extra in extras:
            found.append(copied(folder / extra, folder / "plain", wheel, extra))
            shutil.rmtree(folder / extra)
        for python in given.python or ([] if given.extras else others()):
            found.append(fresh(folder / "other", python, wheel, "corral", WITHOUT_PYBULLET))
            shutil.rmtree(folder / "other")
    if given.write:
        PAGE.write_text(filled(PAGE.read_text(), "sizes", table(found)))


def known_extras() -> list[str]:
    """All extras but `dev`, which is for work on the project itself."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return [extra for extra in project["optional-dependencies"] if extra != "dev"]


def others() -> list[str]:
    """Other Pythons that are at hand."""
    found = []
    for name in OTHER_PYTHONS:
        path = shutil.which(name)
        # A link of a version manager is there even if the version is not.
        if path is None or subprocess.run([path, "-c", ""], capture_output=True, check=False).returncode:
            print(f"{name} is not at hand, and not checked", flush=True)
        else:
            found.append(path)
    return found


def run(*command: str | Path, cwd: Path | None = None) -> str:
    """What a command prints; its failure ends the check."""
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONHOME")}
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}", file=sys.stderr)
        sys.exit(1)
    return done.stdout


def fresh(folder: Path, python: str, wheel: Path, extra: str, jobs: tuple[str, ...]) -> Installed:
    """Install into an empty environment, and do these jobs there."""
    began = time.perf_counter()
    run(python, "-m", "venv", folder)
    return used(folder, wheel, extra, jobs, began)


def copied(folder: Path, plain: Path, wheel: Path, extra: str) -> Installed:
    """The same in a copy of an environment that holds the wheel without extras, to unpack PyTorch only once."""
    began = time.perf_counter()
    run(sys.executable, "-m", "venv", "--without-pip", folder)
    (there,), (here,) = plain.glob("lib/*/site-packages"), folder.glob("lib/*/site-packages")
    shutil.copytree(there, here, copy_function=os.link, symlinks=True, dirs_exist_ok=True)
    return used(folder, wheel, extra, (extra,), began)


def used(folder: Path, wheel: Path, extra: str, jobs: tuple[str, ...], began: float) -> Installed:
    """Install the wheel with an extra, check that its requirements agree, and do the jobs in an empty folder."""
    python, wanted = folder / "bin" / "python", f"torchvsa[{extra}] @ {wheel.as_uri()}" if extra else str(wheel)
    pip = [python, "-m", "pip", "--disable-pip-version-check"]
    again = ["--force-reinstall", "--no-deps"]  # the command of a copied environment would start the other's Python
    for options in ([], again):
        run(*pip, "install", "--quiet", "--no-compile", "--constraint", CONSTRAINTS, *options, wanted)
    run(*pip, "check")
    megabytes, packages = size(folder), len(run(*pip, "list", "--format", "freeze").splitlines())
    for job in jobs:
        elsewhere = folder / "elsewhere" / job
        elsewhere.mkdir(parents=True)
        run(python, "-P", JOBS, job, cwd=elsewhere)
    version = run(python, "-c", "import sys; print('{}.{}'.format(*sys.version_info))").strip()
    found = Installed(version, extra, packages, megabytes, jobs, time.perf_counter() - began)
    print(found, flush=True)
    return found


def size(folder: Path) -> int:
    """Megabytes of all files of the installed packages."""
    files = (path for site in folder.glob("lib/*/site-packages") for path in site.rglob("*"))
    return round(sum(path.stat().st_size for path in files if path.is_file() and "__pycache__" not in path.parts) / 1e6)


def table(found: list[Installed]) -> str:
    """The environments of this Python as a table: what each extra adds to the package without extras."""
    plain = found[0]
    lines = ["| extra | packages | MB | more than without extras |", "|---|---:|---:|---:|"]
    for one in found:
        if one.python == plain.python:
            more = f"{one.megabytes - plain.megabytes:,}" if one.extra else ""
            lines.append(
                f"| {f'`{one.extra}`' if one.extra else 'none'} | {one.packages} | {one.megabytes:,} | {more} |"
            )
    return "\n".join(lines)


def filled(page: str, name: str, content: str) -> str:
    """A page with new content between the marks of a name. Raises `ValueError` if it has no such marks."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    if begin not in page or end not in page:
        raise ValueError(f"the page has no {begin} ... {end}")
    return re.sub(f"{begin}.*?{end}", lambda _: f"{begin}\n{content}\n{end}", page, flags=re.DOTALL)


if __name__ == "__main__":
    main()
