"""`torchvsa collect FOLDER`: one Parquet file, a table and a page of all runs below a folder."""

from __future__ import annotations

import argparse
import difflib
import math
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from behaviours.commands.parsing import OneLineParser
from experiments.collecting import comparing, gathering, planned, runs, shown, tables
from experiments.collecting.comparing import Comparison, Pair
from experiments.collecting.runs import Run
from experiments.kit import Study, Table, store

MOST_ROWS = 60
"""Rows of a table on the terminal."""


def parser() -> argparse.ArgumentParser:
    """What `torchvsa collect` takes."""
    made = OneLineParser(
        prog="torchvsa collect", description="Gather the runs below a folder, and say what is missing."
    )
    made.add_argument("folder", type=Path, help="a sweep's folder, or any folder with runs below it")
    made.add_argument("--to", type=Path, help="where the results go; FOLDER/collected by default")
    rows = "the rows of rows.parquet: all that was measured (default), or each run's table"
    made.add_argument("--rows", choices=("records", "table"), default="records", help=rows)
    two = made.add_mutually_exclusive_group()
    two.add_argument("--compare", nargs=2, metavar=("A", "B"), help="two runs: their folders, also relative to FOLDER")
    two.add_argument("--by", metavar="SETTING[=A,B]", help="a setting with two values, or two of its values")
    return made


def collect(arguments: Sequence[str], find_study: Callable[[str], Study], console: Console) -> Path:
    """Gather, write `rows.parquet` and `report.html`, and print what there is. Returns the folder of both.

    `find_study` returns a study by its name, or raises `ValueError`. Raises `ValueError` where nothing can be gathered
    or compared.
    """
    given = parser().parse_args(list(arguments))
    every = runs.find(given.folder)
    missing = tables.missing(every, planned.not_begun(given.folder, every))
    done = [run for run in every if run.state == "finished"]
    names = {run.study for run in done}
    studies = {name: _study(name, find_study) for name in sorted(names)}
    found = _compared(given.folder, given.compare, given.by, done, studies)
    to = given.to or given.folder / "collected"
    settings = gathering.differing(done)
    gathered = {}
    if done:
        to.mkdir(parents=True, exist_ok=True)
        store.write_frame(to / "rows.parquet", gathering.gathered(done, settings, given.rows))
        for name, own in gathering.by_study(done).items():
            differ = gathering.differing(own)
            gathered[name] = gathering.table(own, differ, studies[name])
            _print(console, gathered[name])
    for row in missing.rows:  # as lines, since names and reasons are too long for a table on a terminal
        console.print(f"{row['run']}: {row['state']}: {row['why']}", markup=False, highlight=False, soft_wrap=True)
    if found is not None:
        _print_comparison(console, found)
    console.print(f"{len(done)} of {len(every)} runs that were found have finished", soft_wrap=True)
    if not done:
        raise ValueError(f"none of the {len(every)} runs below {given.folder} has results to gather")
    command = shlex.join(["torchvsa", "collect", *arguments])
    page = shown.page(to, every, gathered, studies, settings, missing, found, command)
    page.write(to / "report.html")
    for name, trace in page.failures.items():
        console.print(f"figure {name} could not be drawn: {trace.splitlines()[-1]}", markup=False, soft_wrap=True)
    console.print(f"{to / 'report.html'} shows it; rows.parquet is in the same folder", markup=False, soft_wrap=True)
    return to


def _study(name: str, find_study: Callable[[str], Study]) -> Study | None:
    """A study that is installed; None for one that is not, whose rows are gathered all the same."""
    try:
        return find_study(name)
    except ValueError:
        return None


def _compared(
    folder: Path, two: Sequence[str] | None, by: str | None, done: Sequence[Run], studies: dict[str, Study | None]
) -> Comparison | None:
    if two is not None:
        a, b = (_run(folder, name) for name in two)
        if a.study != b.study:
            raise ValueError(f"{two[0]} holds a run of {a.study}, {two[1]} one of {b.study}: only alike runs compare")
        return comparing.compare([(a, b)], _short(a.name, b.name), studies.get(a.study))
    if by is None:
        return None
    if len(studies) != 1:
        raise ValueError(f"--by compares runs of one study; below {folder} are runs of {', '.join(studies) or 'none'}")
    pairs, alone, values = _by(by, done)
    (study,) = studies.values()
    setting = by.partition("=")[0]
    found = comparing.compare(pairs, (f"{setting}={values[0]}", f"{setting}={values[1]}"), study)
    if alone:
        found.notes.append(f"Without a partner, and so left out: {', '.join(run.name for run in alone)}.")
    return found


def _short(a: str, b: str) -> tuple[str, str]:
    """Names of the two runs: A and B where they are too long for the head of a table."""
    return (a, b) if max(len(a), len(b)) <= 30 else ("A", "B")


def _run(folder: Path, name: str) -> Run:
    """A finished run by its folder. Raises `ValueError` if it is not one."""
    place = folder / name if (folder / name).is_dir() else Path(name)
    if not place.is_dir():
        raise ValueError(f"--compare {name}: there is no folder {place}")
    if not any((place / file).is_file() for file in runs.FILES):
        raise ValueError(
            f"--compare {name}: {place} is not the folder of a run; it has none of {', '.join(runs.FILES)}"
        )
    found = runs.read(place, name)
    if found.state != "finished":
        raise ValueError(f"--compare {name}: this run is {found.state}: {found.why}")
    return found


def _by(by: str, done: Sequence[Run]) -> tuple[list[Pair], list[Run], tuple[str, str]]:
    setting, _, listed = by.partition("=")
    known = list(dict.fromkeys(value for run in done if (value := comparing.value_of(run, setting)) is not None))
    if not known:
        names = sorted({name for run in done for name in run.settings})
        near = difflib.get_close_matches(setting, names, 1)
        differ = ", ".join(gathering.differing(done)) or "none"
        hint = f"did you mean {near[0]}?" if near else f"those that differ are {differ}"
        raise ValueError(f"--by {setting}: the runs have no such setting; {hint}")
    values = tuple(listed.split(",")) if listed else tuple(sorted(known, key=_number))
    if len(values) != 2 or values[0] == values[1] or not set(values) <= set(known):
        raise ValueError(f"--by {by}: write two of its values, --by {setting}=A,B; the runs have {', '.join(known)}")
    pairs, alone = comparing.by_setting(done, setting, (values[0], values[1]))
    if not pairs:
        raise ValueError(f"--by {by}: no two runs differ in {setting} only")
    return pairs, alone, (values[0], values[1])


def _number(text: str) -> tuple[float, str]:
    """What values are sorted by: numbers by size, before words."""
    try:
        return float(text), text
    except ValueError:
        return math.inf, text


def _print(console: Console, table: Table) -> None:
    table.show(table.rows[:MOST_ROWS]).print(console)
    if len(table.rows) > MOST_ROWS:
        console.print(f"the first {MOST_ROWS} of {len(table.rows):,} rows; the page has more", soft_wrap=True)


def _print_comparison(console: Console, found: Comparison) -> None:
    for note in found.notes:
        console.print(note, markup=False, soft_wrap=True)
    if not found.settings:
        console.print("no setting differs", soft_wrap=True)
    else:
        _print(console, tables.settings(found))
    if found.differences:
        _print(console, tables.differences(found))
    elif found.metrics:
        _print(console, tables.metrics(found))
    if found.equal:
        console.print(f"{found.equal:,} numbers are the same in both", soft_wrap=True)
