"""Whether the installed packages can run the studies: nothing is missing, and no other package took a name."""

import base64
import hashlib
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

NAMES = ("torchvsa", "behaviours", "sim", "experiments")
"""What this distribution installs, as names to import."""
_NEEDED = (
    "hydra",
    "hydra_plugins",
    "joblib",
    "cloudpickle",
    "pandas",
    "pyarrow",
    "seaborn",
    "matplotlib",
    "jinja2",
    "rich",
    "sklearn",
    "scipy",
    "gymnasium",
    "py_trees",
)


def problem() -> ImportError | None:
    """What keeps the studies from running, in one line; None if nothing does. It takes a few milliseconds."""
    for name in NAMES:
        ours = Path(__file__).parents[1] / name / "__init__.py"
        spec = find_spec(name)
        if spec is not None and spec.origin is not None and Path(spec.origin).resolve() != ours.resolve():
            return ImportError(f"`import {name}` finds {spec.origin} instead of {ours}; rename or remove it", name=name)
        if _overwritten(ours):
            rule = "install the two in different environments"
            return ImportError(f"{_others(name)} has overwritten {ours} of torchvsa; {rule}", name=name)
    missing = next((name for name in _NEEDED if find_spec(name) is None), None)
    if missing is None:
        return None
    return ImportError(f"{missing} is missing; the experiments need: pip install 'torchvsa[corral]'", name=missing)


def shared_names() -> list[str]:
    """A line for each name to import that another installed distribution brings too. It reads what all brought."""
    found = metadata.packages_distributions()
    shared = {name: sorted({*found.get(name, [])} - {"torchvsa"}) for name in NAMES}
    return [
        f"{', '.join(others)} installs a package {name} too, as torchvsa does: the one installed last has replaced the "
        "other's files; install the two in different environments"
        for name, others in shared.items()
        if others
    ]


def _others(name: str) -> str:
    others = {*metadata.packages_distributions().get(name, [])} - {"torchvsa"}
    return ", ".join(sorted(others)) or "another package"


def _overwritten(path: Path) -> bool:
    """Whether a file is not what pip installed; files that pip did not install, as in a checkout, are as they are."""
    try:
        installed = metadata.distribution("torchvsa")
    except metadata.PackageNotFoundError:
        return False
    for file in installed.files or []:
        if file.name == path.name and file.parent.name == path.parent.name and file.locate() == path:
            if file.hash is None or file.hash.mode != "sha256":
                return False
            digest = base64.urlsafe_b64encode(hashlib.sha256(path.read_bytes()).digest()).rstrip(b"=").decode()
            return digest != file.hash.value
    return False
