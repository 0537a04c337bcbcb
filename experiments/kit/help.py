"""What a study can be told: its settings with their meaning, the options of groups, and its presets."""

from __future__ import annotations

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
    groups = {
        field.metadata["group"] for field in study.settings.__dataclass_fields__.values() if "group" in field.metadata
    }
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
