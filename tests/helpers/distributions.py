"""The wheel and the source distribution of this project, built from a copy of its tracked files."""

import subprocess
import sys
from pathlib import Path

from packages import ROOT


def tracked() -> list[str]:
    """The files of the project: those that git tracks, or in a source distribution those that it lists."""
    if (ROOT / ".git").exists():
        listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        return sorted(name for name in listed.split("\n") if name and (ROOT / name).is_file())
    sources = (ROOT / "torchvsa.egg-info" / "SOURCES.txt").read_text().split("\n")
    return sorted(name for name in sources if name and (ROOT / name).is_file() and ".egg-info/" not in name)


def build(folder: Path) -> tuple[Path, Path]:
    """Build both into `folder`: first the source distribution, then the wheel from that. Returns wheel and source."""
    for name in tracked():
        copy = folder / "source" / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes((ROOT / name).read_bytes())
    command = [sys.executable, "-m", "build", "--outdir", folder, folder / "source"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"the project cannot be built:\n{done.stdout}{done.stderr}")
    (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, source
