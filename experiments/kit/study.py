"""A study: for each cell of a grid of factors, measure numbers; then aggregate, and draw."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.kit.columns import Table
from experiments.kit.page import Page
from experiments.kit.settings import Settings
from torchvsa.registry import Registry

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Cell = dict[str, Any]
"""One combination of the factors: names and plain values (numbers, text, None)."""
Row = dict[str, Any]


def grid(**factors: Iterable[Any]) -> list[Cell]:
    """All combinations of the factors' values, the last factor changing fastest.

    >>> grid(dim=[500, 1000], repeat=range(2))[1]
    {'dim': 500, 'repeat': 1}
    """
    return [dict(zip(factors, values, strict=True)) for values in itertools.product(*factors.values())]


@dataclass(frozen=True)
class Outcome:
    """What a run found.

    Attributes:
        folder: where it lies.
        settings: the study's settings.
        config: the same as plain data.
        records: a row for each record that was measured: the cell's factors and its numbers.
        table: a row for each aggregate, as plain data.
        metrics: flat name to number.
        provenance: commit, versions, date, machine and command.
    """

    folder: Path
    settings: Any
    config: dict[str, Any]
    records: pd.DataFrame
    table: list[Row]
    metrics: dict[str, float | None]
    provenance: dict[str, Any]


@dataclass(frozen=True)
class Drawing:
    """A figure of the page: its file's name, how it is drawn, what it shows in words, and its caption.

    Its data are the records, unless `data` says otherwise.
    """

    name: str
    draw: Callable[[Outcome], Figure]
    alt: str
    caption: str = ""
    data: Callable[[Outcome], pd.DataFrame] = lambda outcome: outcome.records


def plain_page(page: Page, outcome: Outcome, study: Study) -> None:
    """The page of most studies: figures, tables, and how the numbers came about."""
    if study.figures:
        section = page.section("Results")
        for one in study.figures:
            section.figure(one.name, lambda one=one: one.draw(outcome), one.alt, one.caption, one.data(outcome))
    for table in study.shown(outcome):
        page.section(table.title).table(table)
    if study.method:
        paragraphs = study.method.strip().split("\n\n")
        page.section("How it was measured").text(*(" ".join(text.split()) for text in paragraphs))


@dataclass(frozen=True)
class Study:
    """One question, and how it is answered.

    Attributes:
        name: of the command and of the folder of its results.
        about: the question, in one sentence.
        settings: a dataclass derived from `kit.Settings`.
        cells: the grid, from the settings; cells that take longest come first.
        measure: `measure(material, cell)` returns one row of numbers, or several. It runs in other processes, and
            depends on nothing but its arguments.
        summarise: `summarise(settings, records)` returns the rows of the table.
        keys: the columns of the table that name a row; all its other numbers become metrics `{key}.{key}.{column}`.
        units: the columns of the records that, with the cell's factors and `keys`, say what a row was measured on (a
            start, a fold), so that rows of two runs can be compared in pairs.
        prepare: `prepare(settings, folder, progress)` returns what all cells share, by default the settings. It runs
            once, if any cell is missing; files that it writes to the folder can be used by the page.
        check: raises `ValueError` for settings that cannot work, before anything is prepared.
        metrics: further metrics, from the settings, the records and the table.
        table: the columns of the table, as shown on the terminal and the page.
        tables: tables to show, where one of all rows is not what a reader needs.
        figures: of the page.
        headline: the result in one sentence.
        method: how the numbers came about, paragraphs parted by an empty line.
        page: `page(page, outcome, study)` fills the page with sections, where the usual ones are not enough.
        presets: settings by name, for `experiment={name}`; a preset may have `defaults` that choose options.
        objective: the metric that a job returns, for Hydra's sweepers that optimise.
    """

    name: str
    about: str
    settings: type[Settings]
    cells: Callable[[Any], Sequence[Cell]]
    measure: Callable[[Any, Cell], Row | list[Row]]
    summarise: Callable[[Any, pd.DataFrame], list[Row]]
    keys: Sequence[str]
    units: Sequence[str] = ()
    prepare: Callable[[Any, Path, Any], Any] = lambda settings, folder, progress: settings
    check: Callable[[Any], None] = lambda settings: None
    metrics: Callable[[Any, pd.DataFrame, list[Row]], Mapping[str, float | None]] = lambda *given: {}
    table: Table | None = None
    tables: Callable[[Outcome], list[Table]] | None = None
    figures: Sequence[Drawing] = ()
    headline: Callable[[Outcome], str] = lambda outcome: ""
    method: str = ""
    page: Callable[[Page, Outcome, Study], None] = plain_page
    presets: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    objective: str | None = None

    def __post_init__(self) -> None:
        STUDIES.register(self.name, self)

    def shown(self, outcome: Outcome) -> list[Table]:
        """The tables of an outcome, for the terminal and the page."""
        found = [] if self.table is None else [self.table.show(outcome.table)]
        return found if self.tables is None else self.tables(outcome)


STUDIES: Registry[Study] = Registry("study")
"""All studies, by the name of their command: a study registers itself when it is made (see `torchvsa.plugins`)."""
