"""`torchvsa learn LOG`: from a log to a bank, with a score by run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from behaviours.bank import BehaviourBank
from behaviours.commands.parsing import OneLineParser
from behaviours.commands.schema_file import read_schema, write_schema
from behaviours.commands.validate import (
    LEVELS,
    SMOOTH,
    Validation,
    cross_validate,
    default_rule,
    folds_of,
    is_smooth,
    space_of,
    sweep,
    taught,
    thinned,
)
from behaviours.data.log import Log
from behaviours.data.reading import read
from behaviours.demonstrations import Demonstrations
from behaviours.learning import no_convergence_warnings
from behaviours.options import as_int
from behaviours.progress import Progress, no_progress
from behaviours.proposal import propose
from behaviours.report import LearningReport
from behaviours.schema import Schema

VALIDATED = 10_000
"""Scores are measured with at most this many rows, evenly spread over the log: more hardly change them."""


@dataclass(frozen=True)
class Options:
    """What `torchvsa learn` was asked for."""

    log: Path
    sensors: list[str] | None
    actuators: list[str] | None
    by: str | None
    schema: Path | None
    propose: Path | None
    output: Path
    page: Path | None
    name: str
    commands: str
    dim: int
    seed: int


@dataclass(frozen=True)
class Learned:
    """What was learned, and how well."""

    options: Options
    schema: Schema
    by: str | None
    """What names the run of each row; None if stretches of time are held out."""
    notes: list[str]
    """What each column was taken for."""
    shown: Demonstrations
    report: LearningReport
    validation: Validation
    kind: str
    """Whether its commands are levels or smooth, as `behaviours.commands.validate.OURS` names them."""
    by_size: list[dict[str, Any]]
    """The errors by dimensions and bins, see `sweep`."""


def options_of(arguments: Sequence[str]) -> Options:
    """The options in these arguments of the command line. Raises `ValueError` for wrong ones."""
    parser = OneLineParser(
        prog="torchvsa learn",
        description="Learn a behaviour from a log, and compare it by run with other models.",
        epilog="torchvsa learn log.csv --sensors front left --actuators v omega --by run --output bank.safetensors",
    )
    parser.add_argument("log", type=Path, help="CSV, Parquet, or another format that behaviours.data.read knows")
    parser.add_argument("--sensors", nargs="+", metavar="COLUMN", help="default: all columns that can be sensors")
    parser.add_argument("--actuators", nargs="+", metavar="COLUMN", help="the columns of commands")
    parser.add_argument("--by", metavar="COLUMN", help="the column that names the run of each row")
    parser.add_argument("--schema", type=Path, metavar="YAML", help="sensors and actuators, instead of names")
    parser.add_argument("--propose", type=Path, metavar="YAML", help="write the schema to correct it, learn nothing")
    parser.add_argument("--output", type=Path, default=Path("bank.safetensors"), help="default: %(default)s")
    parser.add_argument("--page", type=Path, help="default: the output with the suffix .html")
    parser.add_argument("--no-page", action="store_true", help="learn and compare only, which is faster")
    parser.add_argument("--name", help="of the behaviour; default: that of the log")
    kinds = "auto", "levels", "smooth"
    parser.add_argument("--commands", choices=kinds, default="auto", help="default: the better of levels and smooth")
    parser.add_argument("--dim", type=int, default=4000, help="elements of the hypervector; default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="of codebooks and training; default: %(default)s")
    given = parser.parse_args(arguments)
    if given.schema is not None and (given.sensors or given.actuators):
        raise ValueError("--schema names sensors and actuators; leave out --sensors and --actuators")
    page = None if given.no_page else given.page or given.output.with_suffix(".html")
    for path in (given.propose, given.output, page):
        if path is not None and not path.absolute().parent.is_dir():
            raise FileNotFoundError(f"cannot write {path}: there is no such folder")
        if path is not None and path.absolute() == given.log.absolute():
            raise ValueError(f"{path} is the log itself; write to another file")
    return Options(
        given.log, _names(given.sensors), _names(given.actuators), given.by, given.schema, given.propose, given.output,
        page, given.name or given.log.stem, given.commands, as_int("--dim", given.dim, 1),
        as_int("--seed", given.seed, 0),
    )  # fmt: skip


def _names(given: list[str] | None) -> list[str] | None:
    """Names that are separated by spaces, by commas, or by both."""
    return None if given is None else [name for part in given for name in part.split(",") if name]


def proposed(options: Options) -> Path:
    """Write the schema of a log to a file that can be corrected."""
    if options.propose is None:
        raise ValueError("where to? give a file, --propose robot.yaml")
    log = read(options.log)
    found = propose(log, options.sensors, options.actuators, _by(log, options.by))
    return write_schema(options.propose, Schema(found.sensors, found.actuators), options.by, found.lines())


@no_convergence_warnings()
def learn(options: Options, progress: Callable[[str], Progress] = lambda what: no_progress) -> Learned:
    """Learn a log, write the bank, and cross-validate by run.

    Args:
        options: See `options_of`.
        progress: Returns the callback for a part of the work that is named in words.

    Raises:
        ValueError: In one line, for what cannot be learned; before anything is written.
    """
    log = read(options.log)
    if options.schema is None:
        by = _by(log, options.by)
        found = propose(log, options.sensors, options.actuators, by)
        schema, notes = Schema(found.sensors, found.actuators), found.lines()
    else:
        schema, by = read_schema(options.schema)
        by, notes = options.by or by, []
    shown = Demonstrations.from_data(log, schema, by)
    del log
    shown, blind = _observed(shown)
    if blind:
        notes.append(f"{blind} rows without any reading: left out")
    some = thinned(shown, VALIDATED)
    if by is None and len(shown.episodes.unique()) > 1:
        by = "episode"  # the format itself tells runs apart
    folds = folds_of(some, by)
    space = space_of(schema, options.dim, options.seed)
    kinds = _kinds(options.commands, schema, shown)
    held = f"hold out {'runs' if by else 'stretches of time'}, {len(np.unique(folds))} times"
    validation = cross_validate(space, some, folds, kinds, progress(held))
    kind = min(kinds, key=lambda kind: validation.relative(kind, schema).mean())
    given = taught(kind, shown)
    bank = BehaviourBank(space)
    report = bank.learn(options.name, given, default_rule(kind, len(shown)), progress(f"learn {len(given):,} rows"))
    bank.save(options.output)
    if len(given) < len(shown):
        notes.append(f"smooth commands: learned from {len(given):,} rows, evenly spread over the log")
    by_size = [] if options.page is None else sweep(space, some, folds, kind, progress("vary d and bins"))
    return Learned(options, schema, by, notes, shown, report, validation, kind, by_size)


def _kinds(commands: str, schema: Schema, shown: Demonstrations) -> list[str]:
    """The kinds of commands that are compared; the first is taken if they are equally good."""
    if commands != "auto":
        return [{"levels": LEVELS, "smooth": SMOOTH}[commands]]
    return [LEVELS, SMOOTH] if is_smooth(schema, shown) else [LEVELS]


def _by(log: Log, by: str | None) -> str | None:
    if by is not None and by not in log.columns and log.episodes is not None:
        raise ValueError(f"there is no column {by!r}; this format tells runs apart itself, so leave out --by")
    return by


def _observed(shown: Demonstrations) -> tuple[Demonstrations, int]:
    """The rows in which at least one sensor was observed, and how many others there are."""
    blind = shown.sensors.isnan().all(1)
    if blind.all():
        raise ValueError("no row has any reading; all fields of the sensors are empty")
    return (shown.where(~blind), int(blind.sum())) if blind.any() else (shown, 0)


def score_rows(learned: Learned) -> list[dict[str, Any]]:
    """For each model, the mean absolute error of each actuator in rows of runs that it was not shown."""
    validation = learned.validation
    names = [actuator.name for actuator in learned.schema.actuators]
    rows = []
    for model in validation.predicted:
        errors = validation.errors(model).mean(0).tolist()
        agreement = validation.agreement(model, learned.schema).mean(0).tolist()
        rows.append({"model": model} | dict(zip(names, errors, strict=True)))
        rows[-1] |= {f"{name} agreement": share for name, share in zip(names, agreement, strict=True)}
    return rows
