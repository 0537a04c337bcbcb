"""No config names code to run: what would make Hydra import something is refused before Hydra sees it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import yaml

FORBIDDEN = ("_target_", "hydra.callbacks", "hydra/callbacks", "hydra.searchpath", "()")
"""What an override may not contain: a name of code, or a place where Hydra would import something."""

SHELL = ("setup", "additional_parameters")
"""Settings of launchers that become lines of a shell script: for the command line, not for files of presets."""

LOGGING = ("hydra.job_logging", "hydra.hydra_logging")
"""Python's logging makes objects of the classes that its configuration names."""


def refuse_code(arguments: Sequence[str]) -> None:
    """Raise `ValueError` for arguments, and for files below `--config-dir`, that name code to run."""
    for place, argument in enumerate(arguments):
        if found := next((word for word in FORBIDDEN if word in argument), None):
            raise ValueError(f"{argument}: {found} could run code that a setting names; no setting may")
        if any(place in argument for place in LOGGING) and "level" not in argument:
            raise ValueError(f"{argument}: of Python's logging, settings change nothing but levels")
        if argument.split("=")[0] in ("--config-path", "-cp", "--config-name", "-cn"):
            raise ValueError(f"{argument}: a study has its own config; --config-dir adds a folder of presets")
        if argument.split("=")[0] in ("--config-dir", "-cd"):
            folder = argument.partition("=")[2] or (arguments[place + 1] if place + 1 < len(arguments) else "")
            for path in sorted(Path(folder).rglob("*.yaml")):
                _refuse_in(path)


def _refuse_in(path: Path) -> None:
    try:
        content = yaml.safe_load(path.read_text())
    except yaml.YAMLError as error:
        raise ValueError(f"{path}: {error}") from error
    for key in _keys(content):
        if found := next(
            (
                word
                for word in (*FORBIDDEN, *SHELL, "callbacks", "searchpath", "job_logging", "hydra_logging")
                if word in key
            ),
            None,
        ):
            raise ValueError(f"{path}: {found} could run code that a setting names; no setting may")


def _keys(content: Any) -> Iterable[str]:
    if isinstance(content, dict):
        for key, value in content.items():
            yield str(key)
            yield from _keys(value)
    elif isinstance(content, list):
        for entry in content:
            yield from _keys(entry)
