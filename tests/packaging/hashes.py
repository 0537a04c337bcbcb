"""Write `requirements-hashed.txt`: the versions of `constraints.txt`, each with the hash of the file that pip takes.

`python tests/packaging/hashes.py` asks pip, which installs nothing; `make hashes` calls it. For Linux on x86_64, Python
3.11 and PyTorch's CPU build, as the versions are.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from packages import ROOT

TITLE = """\
# The versions of constraints.txt with the hashes of their files: Linux on x86_64, Python 3.11, PyTorch for the CPU.
# Written by `make hashes`. To install exactly these files, and torchvsa beside them:
#   pip install --require-hashes --no-deps -r requirements-hashed.txt --extra-index-url https://download.pytorch.org/whl/cpu
#   pip install --no-deps --no-build-isolation .
"""


def pins() -> list[str]:
    """The lines of `constraints.txt` without comments."""
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def hashed() -> str:
    """A line for each pin, with the hash of the file that pip would install here."""
    with tempfile.TemporaryDirectory() as folder:
        wanted, report = Path(folder, "pins.txt"), Path(folder, "report.json")
        wanted.write_text("\n".join(pins()))
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        asked = ["--dry-run", "--ignore-installed", "--no-deps", "--report", report, "--requirement", wanted]
        subprocess.run([*pip, *asked], check=True)
        found = json.loads(report.read_text())["install"]
    hashes = {plain(one["metadata"]["name"]): one["download_info"]["archive_info"]["hashes"]["sha256"] for one in found}
    lines = [f"{pin} --hash=sha256:{hashes[plain(pin.split('==')[0])]}" for pin in pins()]
    return TITLE + "\n".join(lines) + "\n"


def plain(name: str) -> str:
    """The name of a distribution as indices compare it."""
    return name.lower().replace("_", "-").replace(".", "-")


if __name__ == "__main__":
    (ROOT / "requirements-hashed.txt").write_text(hashed())
