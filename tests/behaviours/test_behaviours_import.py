"""What `import behaviours` needs: the rest is loaded by those who ask for it."""

import subprocess
import sys

SCRIPT = """
import sys
import torchvsa, safetensors.torch
before = set(sys.modules)
import behaviours
print("\\n".join({name.partition(".")[0] for name in set(sys.modules) - before}))
"""


def test_importing_needs_torchvsa_and_safetensors_alone() -> None:
    """In a fresh interpreter: what this one has loaded says nothing."""
    ran = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert set(ran.stdout.split()) - set(sys.stdlib_module_names) <= {"behaviours", "torchvsa"}
