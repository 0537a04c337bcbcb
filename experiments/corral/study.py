"""Show the corral escape, learn it as one hypervector, drive, and compare.

The teacher (the paper's five if-else rules) drives a simulated robot with real-valued sensors. Its runs are the
demonstrations. Each controller of the table learns from them or is a reference point, is asked about held-out runs
of the teacher (agreement), and then drives by itself from held-out starts (success).

    torchvsa corral
    torchvsa corral --multirun vsa.dim=1000,4000 seed=0,1
    torchvsa corral controllers=[teacher,default] encoder.bins=16
"""

import pandas as pd

from experiments.corral import tables, text
from experiments.corral.measure import measure, prepare
from experiments.corral.page import page
from experiments.corral.settings import PRESETS, Corral, check
from experiments.kit import Cell, Row, Study, grid
from experiments.kit.intervals import proportion

SLOWEST = ("teacher_wheeled", "paper_best_bins", "bundled", "default", "paper")


def cells(settings: Corral) -> list[Cell]:
    """A cell for each controller; those that take longest first."""
    order = [*(name for name in SLOWEST if name in settings.controllers), *settings.controllers]
    return grid(controller=dict.fromkeys(order))


def summarise(settings: Corral, records: pd.DataFrame) -> list[Row]:
    """A row for each controller, with its success on the starts that all controllers of the table drove."""
    measured, episodes = tables.by_controller(records), tables.episodes_of(records)
    common = tables.shared_success(episodes, settings.controllers)
    rows = []
    for name in settings.controllers:
        success = common[name]
        shared = {"common_episodes": len(success), **proportion("common", int(success.sum()), len(success))}
        numbers = measured[name] | shared
        rows.append({"controller": name, **{column: numbers.get(column) for column in tables.NUMBERS}})
    return rows


def metrics(settings: Corral, records: pd.DataFrame, table: list[Row]) -> dict[str, float | None]:
    """What the table has no room for."""
    measured = tables.by_controller(records)
    found = {
        f"{name}.{key}": value
        for name in settings.controllers
        for key, value in measured[name].items()
        if key not in tables.NUMBERS
    }
    for row in tables.learning(records):
        counts = {key: float(value) for key, value in row.items() if isinstance(value, int)}
        found |= {f"{row['controller']}.learning.{row['behaviour']}.{key}": value for key, value in counts.items()}
    if {"teacher", "teacher_wheeled"} <= set(settings.controllers):
        planar, wheeled = tables.shared_success(tables.episodes_of(records), ["teacher", "teacher_wheeled"]).values()
        found["wheeled_minus_planar_success"] = float(wheeled.mean() - planar.mean())
    return found


study = Study(
    name="corral",
    about="Can one hypervector, learned from demonstrations, drive a robot as its teacher does?",
    settings=Corral,
    check=check,
    prepare=prepare,
    cells=cells,
    measure=measure,
    summarise=summarise,
    keys=("controller",),
    metrics=metrics,
    table=tables.MAIN,
    headline=text.headline,
    page=page,
    presets=PRESETS,
    objective="default.success_rate",
)
