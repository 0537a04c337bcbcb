"""A study as a command: Hydra's overrides and sweeps, one line for what the user can mend, and a result folder."""

from __future__ import annotations

import copyreg
import dataclasses
import hashlib
import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import hydra
import joblib
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console

from experiments.kit import run as runs
from experiments.kit.console import wide_console
from experiments.kit.messages import in_words, of_cluster
from experiments.kit.options import refuse_no_names, register_groups
from experiments.kit.pool import jobs_end_with_this_process
from experiments.kit.safety import refuse_code
from experiments.kit.settings import NO_MATTER
from experiments.kit.signals import ended_by_signals
from experiments.kit.study import Outcome, Study

TRACEBACK_WANTED = os.environ.get("HYDRA_FULL_ERROR") == "1"
"""Whether the user asked Hydra for whole tracebacks, read before this module sets the same variable."""

LONGEST_NAME = 80
FLAGS = (
    "--help",
    "-h",
    "--multirun",
    "-m",
    "--config-dir",
    "-cd",
    "--cfg",
    "-c",
    "--resolve",
    "--package",
    "-p",
    "--info",
    "-i",
)
"""Flags of Hydra's that a study takes; `kit.safety` refuses others that would choose another config."""

MENDABLE = (HydraException, OmegaConfBaseException, ValueError, TypeError, OSError, ImportError, MemoryError)
"""Errors that the user can mend; any other is a fault of a study, whose traceback is wanted."""

# Dataclasses of a script or a notebook travel to the processes of a sweep by value. What marks a field without a
# default must stay the object that `dataclasses` compares with.
copyreg.pickle(type(dataclasses.MISSING), lambda missing: "MISSING")


def run_study(study: Study, arguments: Sequence[str] | None = None) -> None:
    """Run a study with Hydra's overrides, by default those of this process."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if {"--help", "-h"} & set(given):
        from experiments.kit.help import print_help

        print_help(study, Console())
        return
    with errors_in_one_line(study.name), ended_by_signals(), jobs_end_with_this_process(), _jobs_waited_for():
        refuse_code(given)
        refuse_unknown_flags(given)
        refuse_no_names(given)
        register(study)
        # Hydra reads them there, and takes settings on one side of its flags only.
        sys.argv[1:] = sorted(given, key=lambda argument: argument not in ("--multirun", "-m"))
        hydra.main(version_base="1.3", config_path="pkg://experiments.kit.conf", config_name=study.name)(_Job(study))()


def run_overrides(study: Study, overrides: Sequence[str], console: Console | None = None) -> Outcome:
    """Run a study from Python, with overrides as on the command line, or go on with such a run.

    It is in the folder that the same job of a sweep has: `outputs/<study>/sweep/<overrides>`, so that it goes on where
    that one stopped, and the other way round. Errors are raised as they are.
    """
    refuse_code(overrides)
    refuse_no_names(overrides)
    register(study)
    with hydra.initialize_config_module("experiments.kit.conf", version_base="1.3"):
        settings = runs.settings_of(study, hydra.compose(study.name, list(overrides)))
    named = sorted(one for one in overrides if one.partition("=")[0] not in NO_MATTER)
    folder = Path("outputs", study.name, "sweep", folder_name(",".join(named)))
    with _dask_cluster():
        return runs.run(study, settings, folder, console or Console(quiet=True))


def refuse_unknown_flags(arguments: Sequence[str]) -> None:
    """Raise `ValueError` for flags that are none of Hydra's, and for settings that would be left out."""
    for argument in arguments:
        name = argument.partition("=")[0]
        if name.startswith("~"):
            raise ValueError(f"{argument}: no setting can be left out; write {name[1:]}=value")
        if name.startswith("-") and name not in FLAGS:
            raise ValueError(f"{argument}: there is no such flag; choose from {', '.join(FLAGS)}")


class _Job:
    """One job of a study; it can be sent to another process."""

    def __init__(self, study: Study) -> None:
        self.study = study
        self.__name__ = study.name

    def __call__(self, cfg: DictConfig) -> float | None:
        study = self.study
        console = wide_console()
        # A sweep goes on after a job that failed, and Hydra then says which one it was.
        alone = HydraConfig.get().mode == RunMode.RUN
        with errors_in_one_line(study.name) if alone else nullcontext():
            folder = Path(HydraConfig.get().runtime.output_dir)
            try:
                with _dask_cluster():
                    outcome = runs.run(study, runs.settings_of(study, cfg), folder, console)
            except ValueError:
                with suppress(OSError):
                    folder.rmdir()  # which Hydra makes, also for settings that are refused
                raise
        for table in study.shown(outcome):
            table.print(console)
        report = outcome.folder / "report.html"
        console.print(f"{report} shows it; results.json and records.parquet are in the same folder", soft_wrap=True)
        return None if study.objective is None else outcome.metrics.get(study.objective)


def _jobs_waited_for() -> AbstractContextManager[None]:
    """What sweeps with submitit need, if it is installed."""
    if find_spec("submitit") is None:
        return nullcontext()
    from experiments.kit.submitit_jobs import waited_for

    return waited_for()


@contextmanager
def _dask_cluster() -> Iterator[None]:
    """The cluster at `DASK_SCHEDULER_ADDRESS`, by which Dask's own clients find one, measures the cells."""
    address = os.environ.get("DASK_SCHEDULER_ADDRESS")
    if not address:
        yield
        return
    from dask.distributed import Client

    try:
        client = Client(address)
    except (OSError, ValueError) as error:
        raise OSError(f"there is no Dask scheduler at {address}, which DASK_SCHEDULER_ADDRESS names") from error
    with client, joblib.parallel_config(backend="dask"):
        yield


def register(study: Study) -> None:
    """Put the settings of a study, its presets and all options into Hydra's store."""
    store = ConfigStore.instance()
    register_groups()
    store.repo.pop("experiment", None)  # presets of another study that this process ran
    for name, preset in study.presets.items():
        store.store(group="experiment", name=name, node=dict(preset), package="_global_")
    store.store(name=study.name, node=primary(study))


def primary(study: Study) -> type:
    """The study's settings as Hydra's primary config: with the defaults of its groups, and where results lie."""
    logging = {"override hydra/job_logging": "stdout"}
    defaults = ["_self_", *_defaults(study.settings), {"experiment": None}, logging]
    folder = "${torchvsa.folder:${hydra.job.override_dirname}}"
    hydra_block = {
        "run": {"dir": f"outputs/{study.name}/{folder}"},
        "sweep": {"dir": f"outputs/{study.name}/sweep", "subdir": folder},
        "job": {"name": study.name, "config": {"override_dirname": {"exclude_keys": list(NO_MATTER)}}},
        "job_logging": {"root": {"level": "WARNING"}},
        "output_subdir": None,
    }
    OmegaConf.register_new_resolver("torchvsa.folder", folder_name, replace=True)
    fields = [
        ("defaults", list[Any], dataclasses.field(default_factory=lambda: list(defaults))),
        ("hydra", Any, dataclasses.field(default_factory=lambda: dict(hydra_block))),
    ]
    return dataclasses.make_dataclass(study.settings.__name__, fields, bases=(study.settings,))


def folder_name(overrides: str) -> str:
    """A folder for what was overridden: the same for the same overrides, and readable as long as they are short."""
    name = re.sub(r"[^A-Za-z0-9_.,=+-]+", "_", re.sub(r"[\[\]{}'\"]", "", overrides)).strip("_") or "default"
    if len(name) > LONGEST_NAME or name != overrides:
        digest = hashlib.sha256(overrides.encode()).hexdigest()[:8]
        name = f"{name[:LONGEST_NAME]}-{digest}" if overrides else name
    return name


def _defaults(cls: type, package: str = "") -> Iterator[dict[str, Any]]:
    for field in dataclasses.fields(cls):
        path = f"{package}.{field.name}" if package else field.name
        if "settings" in field.metadata:
            yield from _defaults(field.metadata["settings"], path)
        elif "group" in field.metadata:
            group = field.metadata["group"]
            yield {group if path == group else f"{group}@{path}": field.metadata["option"]}


@contextmanager
def errors_in_one_line(name: str, stopped: str = "stopped; the same command goes on from here") -> Iterator[None]:
    """What the user can mend is told in one line on stderr, with exit status 1; an interrupt in one line with 130.

    With HYDRA_FULL_ERROR=1 in the environment the whole traceback is shown instead.
    """
    before = os.environ.get("HYDRA_FULL_ERROR")
    os.environ["HYDRA_FULL_ERROR"] = "1"  # makes Hydra raise, instead of printing a report of several lines itself
    try:
        yield
    except KeyboardInterrupt:
        print(f"{name}: {stopped}", file=sys.stderr)
        sys.exit(130)
    except Exception as error:
        if TRACEBACK_WANTED or not (isinstance(error, MENDABLE) or of_cluster(error)):
            raise
        print(f"{name}: {in_words(error)}", file=sys.stderr)
        sys.exit(1)
    finally:
        if before is None:
            del os.environ["HYDRA_FULL_ERROR"]
        else:
            os.environ["HYDRA_FULL_ERROR"] = before
