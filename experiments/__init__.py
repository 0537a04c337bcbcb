"""Reproducible studies, one file per question. The only place where robot and algebra meet."""

from importlib.util import find_spec

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

if _missing := next((name for name in _NEEDED if find_spec(name) is None), None):
    raise ImportError(f"{_missing} is missing; the experiments need: pip install 'torchvsa[corral]'", name=_missing)
