"""What a study can be told: its settings with their meaning, the options of groups, and its presets."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.kit.options import described_option, options
from experiments.kit.settings import described
from experiments.kit.study import Study


def print_help(study: Study, console: Console) -> None:
    """Print all that a study can be told."""
    console.print(f"[bold]torchvsa {study.name}[/bold]: {escape(study.about)}\n")
    table = _table("Settings: name=value", "setting", "default", "meaning", "allowed")
    for one in described(study.settings):
        table.add_row(*(escape(text) for text in one))
    console.print(table)
    for group in groups(study.settings):
        title = f"\nOptions of {group}: {group}=option, {group}.setting=value"
        table = _table(title, "option", "setting", "default", "meaning")
        for option in options(group):
            rows = described_option(group, option) or [("", "", "")]
            for place, row in enumerate(rows):
                table.add_row(option if place == 0 else "", *(escape(text) for text in row))
        console.print(table)
    if study.presets:
        console.print(f"\nPresets: experiment={' or experiment='.join(study.presets)}", markup=False)
    console.print(
        "\nSweeps: --multirun name=value,value runs a job for each; hydra/launcher=joblib runs jobs side by side."
        "\nThe same command goes on where it stopped. --config-dir FOLDER adds presets of your own.",
        markup=False,
    )


def groups(settings: type) -> list[str]:
    """The config groups of which settings, and those nested in them, choose options."""

    def found(cls: type) -> Iterator[str]:
        for field in dataclasses.fields(cls):
            if "group" in field.metadata:
                yield field.metadata["group"]
            elif "settings" in field.metadata:
                yield from found(field.metadata["settings"])

    return list(dict.fromkeys(found(settings)))


def markdown(study: Study) -> str:
    """The settings of a study as a section of the docs."""
    rows = [(f"`{name}`", f"`{default}`" * bool(default), *rest) for name, default, *rest in described(study.settings)]
    presets = ", ".join(f"`experiment={name}`" for name in study.presets)
    lines = [f"## {study.name}", study.about, _markdown(("setting", "default", "meaning", "allowed"), rows)]
    return "\n\n".join([*lines, f"Presets: {presets}."] if presets else lines)


def markdown_of_group(group: str) -> str:
    """The options of a config group as a section of the docs."""
    rows = []
    for option in options(group):
        found = [
            (f"`{group}.{name}`", f"`{default}`", about) for name, default, about in described_option(group, option)
        ]
        rows += [(f"`{group}={option}`" * (place == 0), *row) for place, row in enumerate(found or [("", "", "")])]
    return f"## Options of {group}\n\n{_markdown(('option', 'setting', 'default', 'meaning'), rows)}"


def _markdown(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = [[text.replace("|", "\\|") for text in row] for row in (titles, ["---"] * len(titles), *rows)]
    return "\n".join(f"| {' | '.join(row)} |" for row in cells)


def _table(title: str, *columns: str) -> Table:
    table = Table(title=escape(title), box=None, title_justify="left", title_style="bold")
    for column in columns:
        table.add_column(column, overflow="fold")
    return table
