"""What `import torchvsa` costs beyond `import torch`."""

import subprocess
import sys
from collections.abc import Iterator

from benchmarks.harness import Case


def seconds(name: str) -> float:
    """Time that a new process takes to import a module after torch."""
    script = f"import time, torch\nbegan = time.perf_counter()\nimport {name}\nprint(time.perf_counter() - began)"
    return float(subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout)


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """Beside the peer. A case's calls are timed whole, so each of them says itself what it measured."""
    ours, peer = (lambda _, name=name: seconds(name) for name in ("torchvsa", "torchhd"))
    yield Case("import beyond torch", "new process", ours, {"torchhd": peer}, lambda: None, timed=True)
