"""What a study can be told: its settings with their meaning, the options of groups, and its presets."""

from __future__ import annotations

import dataclasses

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.kit.options import GROUPS, options
from experiments.kit.settings import described
from experiments.kit.study import Study


def print_help(study: Study, console: Console) -> None:
    """Print all that a study can be told."""
    console.print(f"[bold]torchvsa {study.name}[/bold]: {escape(study.about)}\n")
    table = Table(title="Settings: name=value", box=None, title_justify="left")
    for column in ("setting", "default", "meaning", "allowed"):
        table.add_column(column, overflow="fold")
    for one in described(study.settings):
        table.add_row(*(escape(text) for text in one))
    console.print(table)
    if groups := groups_of(study.settings):
        table = Table(
            title="\nOptions of groups: group=option; their settings: group.name=value", box=None, title_justify="left"
        )
        table.add_column("group")
        table.add_column("options", overflow="fold")
        for group in GROUPS:
            if group in groups:
                table.add_row(group, ", ".join(options(group)))
        console.print(table)
    if study.presets:
        console.print(f"\nPresets: experiment={' or experiment='.join(study.presets)}", markup=False)
    console.print(
        "\nSweeps: --multirun name=value,value runs a job for each; hydra/launcher=joblib runs jobs side by side."
        "\nThe same command goes on where it stopped. --config-dir FOLDER adds presets of your own.",
        markup=False,
    )


def groups_of(settings: type) -> set[str]:
    """The config groups of which settings, and those nested in them, hold an option."""
    found: set[str] = set()
    for field in dataclasses.fields(settings):
        if "group" in field.metadata:
            found.add(field.metadata["group"])
        elif "settings" in field.metadata:
            found |= groups_of(field.metadata["settings"])
    return found
