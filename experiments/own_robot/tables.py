"""The table of scores, for the terminal and the page."""

import math

from behaviours.commands.learn import Learned, score_rows
from behaviours.parts import Actuator
from experiments.kit.columns import Column, Table


def score_table(learned: Learned) -> Table:
    """The error of each model by actuator, and how often the level is right."""
    columns = [Column("model")]
    held = "runs" if learned.by else "stretches of time"
    for actuator in learned.schema.actuators:
        about = f"mean absolute error of {with_unit(actuator)}, in {held} that were not shown"
        columns.append(
            Column(actuator.name, f"{actuator.name}: error", error_format(actuator), best="min", about=about)
        )
    for actuator in learned.schema.actuators:
        about = f"how often `{actuator.name}` has the demonstrated one of its {actuator.levels} levels"
        key = f"{actuator.name} agreement"
        columns.append(Column(key, f"{actuator.name}: agreement", ".3f", best="max", about=about))
    caption = f"Each model answers {held} that it was not shown; the best of each column is marked."
    return Table("What each model commands", columns, caption).show(score_rows(learned))


def with_unit(part: Actuator) -> str:
    """The name of an actuator, with its unit in brackets."""
    return f"{part.name} [{part.unit}]" if part.unit else part.name


def error_format(part: Actuator) -> str:
    """The format of errors of an actuator: decimals to a ten-thousandth of its range or finer."""
    return f".{max(0, 4 - math.floor(math.log10(part.high - part.low)))}f"
