"""What `import torchvsa` needs."""

import subprocess
import sys

SCRIPT = """
import sys
import torch, numpy, jaxtyping
before = set(sys.modules)
import torchvsa
print("\\n".join({name.partition(".")[0] for name in set(sys.modules) - before}))
"""


def test_importing_needs_torch_numpy_and_jaxtyping_alone() -> None:
    ran = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    new = set(ran.stdout.split()) - set(sys.stdlib_module_names)
    assert new == {"torchvsa"}


def test_all_that_is_public_is_there() -> None:
    import torchvsa

    assert len(set(torchvsa.__all__)) == len(torchvsa.__all__)
    for name in torchvsa.__all__:
        assert getattr(torchvsa, name) is not None
