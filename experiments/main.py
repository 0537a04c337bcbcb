"""The command `torchvsa`: a study by its name, and the page of a finished run drawn again."""

import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

import torchvsa
from behaviours.commands.ask import ask
from behaviours.commands.parsing import OneLineParser
from behaviours.commands.show import show
from experiments import studies
from experiments.installation import shared_names
from experiments.kit import STUDIES
from experiments.kit.command import errors_in_one_line, run_study
from experiments.kit.console import wide_console
from experiments.kit.markdown import write_markdown
from experiments.kit.run import draw, load
from experiments.own_robot.command import learn_log


def main(arguments: Sequence[str] | None = None) -> None:
    """Run `torchvsa STUDY [setting=value ...]`, or one of the commands that `print_commands` lists."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] in ("--help", "-h"):
        print_commands(Console())
        return
    name, rest = given[0], given[1:]
    if name == "--version":
        print("\n".join([f"torchvsa {torchvsa.__version__}", *shared_names()]))
        return
    if name in COMMANDS:
        with errors_in_one_line(f"torchvsa {name}", "stopped"):
            if COMMANDS[name](rest):
                sys.exit(1)
        return
    if name == "settings":
        print(studies.settings_page(), end="")
        return
    with errors_in_one_line("torchvsa"):
        study = studies.find(name)
    run_study(study, rest)


def asked(arguments: Sequence[str]) -> bool:
    """Answer the rows of standard input; whether any could not be answered."""
    if not 1 <= len(arguments) <= 2:
        raise ValueError("write torchvsa ask BANK [NAME], with CSV rows from a pipe")
    name = arguments[1] if len(arguments) > 1 else None
    return ask(arguments[0], name, sys.stdin, sys.stdout, sys.stderr) > 0


def shown(arguments: Sequence[str]) -> bool:
    """Print what is in the files."""
    if not arguments:
        raise ValueError("which file? give one that holds a bank or demonstrations")
    for argument in arguments:
        print(show(argument))
    return False


def rrd_written(arguments: Sequence[str]) -> bool:
    """Write the kept starts of a finished run of the corral as files for Rerun, and print their paths."""
    if not arguments:
        raise ValueError("which folder? give one of a finished run of torchvsa corral")
    from experiments.corral.rrd import write_starts

    for path in write_starts(Path(arguments[0]), arguments[1:]):
        print(path)
    return False


def collected(arguments: Sequence[str]) -> bool:
    """Gather the runs below a folder, and compare two of them."""
    from experiments.collecting.command import collect

    collect(arguments, studies.find, wide_console())
    return False


def drawn_again(arguments: Sequence[str]) -> bool:
    """Draw the pages of finished runs again, from their results."""
    parser = OneLineParser(prog="torchvsa draw", description="Draw the pages of finished runs again.")
    parser.add_argument("folder", nargs="+", type=Path, help="one that holds results.json")
    parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="write the page of one run as Markdown, too")
    given = parser.parse_args(list(arguments))
    if given.markdown is not None and len(given.folder) > 1:
        raise ValueError(f"--markdown {given.markdown}: name one folder; there are {len(given.folder)}")
    studies.import_all()
    for folder in given.folder:
        study, outcome = load(folder)
        page = draw(study, outcome, Console())
        print(outcome.folder / "report.html")
        if given.markdown is not None:
            print(write_markdown(page, given.markdown))
    return False


COMMANDS = {
    "learn": learn_log,
    "ask": asked,
    "show": shown,
    "draw": drawn_again,
    "collect": collected,
    "rrd": rrd_written,
}
"""What works with files; each returns whether something was wrong with what it was given."""


def corral() -> None:
    """Run `torchvsa-corral [setting=value ...]`, which is `torchvsa corral`."""
    main(["corral", *sys.argv[1:]])


def print_commands(console: Console) -> None:
    """What can be run."""
    studies.import_all()
    table = Table(title="torchvsa COMMAND setting=value ...; COMMAND --help lists its settings", box=None)
    table.add_column("command", no_wrap=True)
    table.add_column("what it answers or does")
    for name, study in STUDIES.items():
        table.add_row(name, study.about)
    table.add_row("ask BANK [NAME]", "Answer rows of readings: CSV from a pipe, CSV with commands out.")
    table.add_row("show FILE", "Say what is in a bank or a demonstration file.")
    table.add_row("learn LOG", "Learn a behaviour from a log, compare it by run, and write a bank and a page.")
    table.add_row("draw FOLDER", "Draw the page of a finished run again, from its results; also as Markdown.")
    table.add_row("rrd FOLDER [START ...]", "Write drives of a finished run of corral for the Rerun viewer.")
    table.add_row("collect FOLDER", "Gather the runs of a sweep, say what is missing, and compare two of them.")
    table.add_row("--version", "Print the version, and installed packages that take names of this one.")
    table.add_row("settings", "Print the settings of all studies as Markdown.")
    console.print(table)
