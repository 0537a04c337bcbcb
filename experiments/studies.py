"""All studies: each module and package here that is not shared registers what it defines when it is imported."""

import pkgutil
from importlib import import_module

import experiments
from experiments.kit import STUDIES, Study
from experiments.kit.help import groups, markdown, markdown_of_group

_TITLE = """<!-- Written by `torchvsa settings`; a test compares the two. -->
# Settings

What every study can be told: `torchvsa STUDY setting=value`. `torchvsa STUDY --help` prints the same. A group holds one
of several options: `group=option` chooses one, `group.setting=value` changes it.
"""

_SHARED = ("__main__", "main", "studies", "kit", "models", "tasks")

_MODULES = [module.name for module in pkgutil.iter_modules(experiments.__path__) if module.name not in _SHARED]


def import_all() -> None:
    """Import every module of studies, which takes seconds."""
    for module in _MODULES:
        import_module(f"experiments.{module}")


def find(name: str) -> Study:
    """The study of this name; if a module has its name, no other one is imported. Raises `ValueError` for no study."""
    if name in _MODULES:
        import_module(f"experiments.{name}")
    else:
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
