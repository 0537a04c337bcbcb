"""Run a study in a folder: measure what is missing, write the results, then draw."""

from __future__ import annotations

import json
import shlex
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from omegaconf import OmegaConf
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

import torchvsa
from experiments.kit import store
from experiments.kit.page import Page
from experiments.kit.pool import measured
from experiments.kit.settings import check
from experiments.kit.study import STUDIES, Cell, Outcome, Row, Study


def run(study: Study, settings: Any, folder: Path, console: Console) -> Outcome:
    """Measure all cells of a study, or those that an earlier run left, and write everything to `folder`."""
    check_all(study, settings)
    began = time.perf_counter()
    config = config_of(settings)
    cells = study.cells(settings)
    kept = store.Cells(folder, study.name, config, settings.fresh)
    missing = [cell for cell in cells if kept.find(cell) is None]
    if not missing and finished(folder, study, config):
        console.print(f"{folder} holds the results of these settings; fresh=true begins anew", soft_wrap=True)
        return load(folder, study)[1]
    folder.mkdir(parents=True, exist_ok=True)
    begun = store.Begun(folder, study.name, config, cells)
    if len(missing) < len(cells):
        done = f"{len(cells) - len(missing)} of {len(cells)} cells"
        console.print(f"{folder} holds {done} of these settings; fresh=true begins anew", soft_wrap=True)
    try:
        _measure(study, settings, folder, missing, kept, console)
        records = pd.DataFrame([cell | row for cell in cells for row in kept.find(cell) or []])
        table = [store.plain(row) for row in study.summarise(settings, records)]
        metrics = store.plain({**_metrics(study, table), **study.metrics(settings, records, table)})
    except Exception as error:
        begun.failed(error)
        raise
    outcome = Outcome(folder, settings, config, records, table, metrics, store.provenance(study.name))
    store.write_frame(folder / "records.parquet", records)
    store.write_results(
        folder / "results.json",
        {
            "study": study.name,
            "version": torchvsa.__version__,
            "seed": settings.seed,
            "wall_time_s": round(time.perf_counter() - began, 3),
            "provenance": outcome.provenance,
            "metrics": metrics,
            "table": table,
            "config": config,
        },
    )
    draw(study, outcome, console)
    return outcome


def _measure(
    study: Study, settings: Any, folder: Path, missing: Sequence[Cell], kept: store.Cells, console: Console
) -> None:
    """Measure the missing cells, and keep each as soon as it is done."""
    if not missing:
        return
    with progress_bars(console) as progress:
        material = study.prepare(settings, folder, progress)
        task = progress.add_task("measure", total=len(missing))
        for place, found in measured(study.measure, material, missing, settings.workers):
            kept.add(missing[place], store.plain_rows(found))
            progress.advance(task)


def check_all(study: Study, settings: Any) -> None:
    """Raise `ValueError`, naming the setting, for what cannot work: before anything is prepared or measured."""
    check(settings)
    study.check(settings)


def draw(study: Study, outcome: Outcome, console: Console) -> Page:
    """Write `report.html`. What cannot be drawn is told, and costs nothing else."""
    page = Page(study.name.replace("_", " ").capitalize(), study.about, study.headline(outcome), outcome.folder)
    study.page(page, outcome, study)
    section = page.section("How to reproduce")
    section.text("The same settings give the same numbers, times aside.")
    section.code(shlex.join(outcome.provenance["command"]))
    versions = ", ".join(f"{name} {version}" for name, version in outcome.provenance["versions"].items())
    commit, date, host = (outcome.provenance[key] for key in ("commit", "date", "host"))
    section.text(
        f"Run on {date} on {host} ({outcome.provenance['platform']}), commit {commit or 'unknown'}; {versions}."
    )
    section.code(OmegaConf.to_yaml(OmegaConf.create(outcome.config)), "All settings of this run:")
    page.draw(outcome.settings.workers)
    page.write(outcome.folder / "report.html")
    for name, trace in page.failures.items():
        console.print(f"figure {name} could not be drawn: {trace.splitlines()[-1]}", markup=False, soft_wrap=True)
    return page


def finished(folder: Path, study: Study, config: dict[str, Any]) -> bool:
    """Whether a folder holds the results of a study, in this version and with these settings."""
    if not (folder / "results.json").is_file():
        return False
    found = read_results(folder)
    made = (found["study"], found["version"], store.relevant(found["config"]))
    return made == (study.name, torchvsa.__version__, store.plain(store.relevant(config)))


def load(folder: Path, study: Study | None = None) -> tuple[Study, Outcome]:
    """A study, by default the registered one, and what it found, from the folder of a finished run."""
    content = read_results(folder)
    study = study or STUDIES.find(content["study"])
    settings = settings_of(study, content["config"])
    records = pd.read_parquet(folder / "records.parquet")
    config, table, metrics, provenance = (content[key] for key in ("config", "table", "metrics", "provenance"))
    return study, Outcome(folder, settings, config, records, table, metrics, provenance)


def read_results(folder: Path) -> dict[str, Any]:
    """The content of `results.json`. Raises `ValueError`, naming the file, unless a run wrote it."""
    path = folder / "results.json"
    try:
        content = json.loads(path.read_text())
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not JSON: {error}") from error
    needed = {"study": str, "version": str, "config": dict, "table": list, "metrics": dict, "provenance": dict}
    if not isinstance(content, dict) or not all(isinstance(content.get(key), kind) for key, kind in needed.items()):
        raise ValueError(f"{path} does not hold the results of a study")
    return content


def settings_of(study: Study, config: Any) -> Any:
    """Typed settings of a study from plain data or a config of Hydra's."""
    if OmegaConf.is_config(config):
        config = OmegaConf.to_container(config, resolve=True)
    # Options of groups are checked when Hydra composes them; from here on they are plain.
    return OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(study.settings), config))


def config_of(settings: Any) -> dict[str, Any]:
    """Settings as plain data."""
    found = OmegaConf.to_container(OmegaConf.structured(settings), resolve=True)
    assert isinstance(found, dict)
    return {str(key): value for key, value in found.items()}


def progress_bars(console: Console) -> Progress:
    """Progress bars with counts and times, to be used as a context."""
    columns = (TextColumn("{task.description:>28}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, TimeRemainingColumn(), console=console)


def _metrics(study: Study, table: Sequence[Row]) -> dict[str, Any]:
    """Every number of the table as `key.key.column`; keys that a row does not have are left out."""
    metrics = {}
    for row in table:
        name = ".".join(_short(row[key]) for key in study.keys if row.get(key) is not None)
        for column, value in row.items():
            if column not in study.keys and not isinstance(value, str | list | dict):
                metrics[f"{name}.{column}"] = value
    return metrics


def _short(key: object) -> str:
    """A key as text; numbers as one writes them, `1` for 1.0."""
    return str(int(key)) if isinstance(key, float) and key.is_integer() else str(key)
