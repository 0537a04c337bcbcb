"""The jobs of a sweep that have no results: Hydra writes down what was asked for, and each job names its folder."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import yaml
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException

from experiments.collecting.runs import Run
from experiments.kit.command import folder_name
from experiments.kit.settings import NO_MATTER

FILE = "multirun.yaml"


def not_begun(folder: Path, runs: Iterable[Run]) -> Iterator[str]:
    """The folders of the jobs of the last sweep in each folder of sweeps that are not among the runs."""
    there = {run.folder.resolve() for run in runs}
    for path in sorted(folder.rglob(FILE)):
        for name in jobs(path):
            place = path.parent / name
            if place.resolve() not in there:
                yield place.relative_to(folder).as_posix()


def jobs(path: Path) -> list[str]:
    """The folders' names of the jobs of the sweep of a `multirun.yaml`; none if the file cannot be read."""
    try:
        # CSafeLoader makes plain data only.
        content: Any = yaml.load(path.read_text(), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        asked = OverridesParser.create().parse_overrides(content["hydra"]["overrides"]["task"])
    except (yaml.YAMLError, HydraException, ValueError, LookupError, TypeError, OSError):
        return []
    choices = []
    for override in asked:
        if override.key_or_group in NO_MATTER:
            continue
        key = override.get_key_element()
        if override.is_sweep_override():
            if not override.is_discrete_sweep():
                return []
            choices.append([f"{key}={value}" for value in override.sweep_string_iterator()])
        else:
            choices.append([f"{key}={override.get_value_element_as_str()}"])
    return [folder_name(",".join(sorted(job))) for job in itertools.product(*choices)]
