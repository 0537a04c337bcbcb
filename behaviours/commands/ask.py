"""`torchvsa ask BANK [NAME]`: rows of readings from a pipe, commands to the next one."""

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TextIO

from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.controller import Controller
from behaviours.schema import Schema
from behaviours.tables import checked_names

MEASURES = ("similarity", "margin", "familiarity")
"""What is written after the commands, see `Recall`."""


def ask(path: str | Path, name: str | None, lines: Iterable[str], out: TextIO, problems: TextIO) -> int:
    """Answer CSV rows one by one, each before the next is read; returns how many could not be answered.

    The first line names the columns; those that are no sensors are ignored. An empty field is a reading that was not
    observed. Each answer is a line of the actuators' commands and `MEASURES`, and is flushed. A row that cannot be
    answered gets an empty line of the same width, and a line on `problems` that says why.

    Raises:
        ValueError: The bank cannot be read or has no such behaviour, or a sensor has no column.
    """
    behaviour = chosen(BehaviourBank.load(path), name)
    schema, tick = behaviour.space.schema, behaviour.freeze()
    rows = csv.reader(lines)
    columns = places(next(rows, []), schema)
    head = [*(actuator.name for actuator in schema.actuators), *MEASURES]
    write(out, head)
    failed = 0
    for number, row in enumerate(rows, 1):
        try:
            write(out, answer(tick, schema, columns, row))
        except ValueError as error:
            failed += 1
            print(f"row {number}: {error}", file=problems, flush=True)
            write(out, [""] * len(head))
    return failed


def chosen(bank: BehaviourBank, name: str | None) -> Behaviour:
    """The behaviour of this name, or the only one. Raises `ValueError` that lists the names."""
    if name is None and len(bank) == 1:
        name = next(iter(bank))
    if name is None or name not in bank:
        what = "which behaviour?" if name is None else f"there is no behaviour {name!r};"
        raise ValueError(f"{what} the bank has {', '.join(bank) or 'none'}")
    return bank[name]


def places(header: list[str], schema: Schema) -> list[int]:
    """The column of each sensor. Raises `ValueError` that names what is missing."""
    if not header:
        raise ValueError("there is no header; the first line names the columns")
    names = list(checked_names([title.strip() for title in header], "the columns of the header"))
    if missing := [sensor.name for sensor in schema.sensors if sensor.name not in names]:
        raise ValueError(f"there is no column for {', '.join(missing)}; the header has {', '.join(names)}")
    return [names.index(sensor.name) for sensor in schema.sensors]


def answer(tick: Controller, schema: Schema, columns: list[int], row: list[str]) -> Iterator[str]:
    """The fields of one answer. Raises `ValueError` that names the sensor for a reading that cannot be used."""
    readings: list[float | str] = []
    for sensor, column in zip(schema.sensors, columns, strict=True):
        if column >= len(row):
            raise ValueError(f"sensor {sensor.name!r}: the row has only {len(row)} fields")
        readings.append(reading(sensor.name, sensor.values, row[column].strip()))
    recall = tick([readings])
    values = [*recall.commands[0].tolist(), *(getattr(recall, measure).item() for measure in MEASURES)]
    return ("" if math.isnan(value) else f"{value:.9g}" for value in values)


def reading(name: str, values: Sequence[object], field: str) -> float | str:
    """A field as a number, or as the text that a categorical sensor has for it."""
    if field in map(str, values):
        return field
    try:
        return float(field) if field else math.nan
    except ValueError:
        expected = f"one of {', '.join(map(str, values))}" if values else "a number"
        raise ValueError(f"sensor {name!r}: expected {expected}; got {field!r:.60}") from None


def write(out: TextIO, fields: Iterable[str]) -> None:
    """Write one line, and do not keep it back."""
    out.write(",".join(fields) + "\n")
    out.flush()
