"""All studies: each module here that is not shared, or in a package that is not, registers what it defines."""

import pkgutil
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import experiments
from experiments.kit import STUDIES, Study
from experiments.kit.help import groups, markdown, markdown_of_group

_TITLE = """<!-- Written by `torchvsa settings`; a test compares the two. -->
# Settings

What every study can be told: `torchvsa STUDY setting=value`. `torchvsa STUDY --help` prints the same. A group holds one
of several options: `group=option` chooses one, `group.setting=value` changes it.
"""

_SHARED = ("__main__", "main", "installation", "studies", "kit", "collecting", "models", "tasks")


def _modules() -> Iterator[str]:
    for module in pkgutil.iter_modules(experiments.__path__):
        if module.name not in _SHARED:
            yield module.name
            inner = pkgutil.iter_modules([str(Path(experiments.__path__[0], module.name))])
            yield from (f"{module.name}.{one.name}" for one in inner)


def import_all() -> None:
    """Import every module of studies, which takes seconds."""
    for module in _modules():
        import_module(f"experiments.{module}")


def find(name: str) -> Study:
    """The study of this name. If a module has the name, that one is imported, and others if it needs them.

    Raises `ValueError` if there is no such study.
    """
    own = min((module for module in _modules() if module.split(".")[-1] == name), key=len, default=None)
    if own is not None:
        import_module(f"experiments.{own}")
    if own is None or name not in STUDIES:
        import_all()
    return STUDIES.find(name)


def settings_page() -> str:
    """All settings of the studies of this project, and the options of all groups, as a page of the docs."""
    import_all()
    here = [study for _, study in sorted(STUDIES.items()) if study.settings.__module__.startswith("experiments.")]
    studies = "\n\n".join(map(markdown, here))
    used = dict.fromkeys(group for study in here for group in groups(study.settings))
    options = "\n\n".join(markdown_of_group(group) for group in used)
    return f"{_TITLE}\n{studies}\n\n{options}\n"
