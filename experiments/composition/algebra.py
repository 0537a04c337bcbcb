"""What can be done with behaviours that are vectors, and is the result what theory says?

Each operation of the algebra is measured on behaviours of the corral robot: remove one from a sum, mirror one, compare
two, recognise one from what a robot does, and go over from one to the other.

    torchvsa algebra
    torchvsa algebra operations=[recognition] codebooks.recognition=5 steps=[1,10,50]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from experiments.composition import algebra_figures, algebra_tables, operations
from experiments.composition.operations import EIGHT, RULES, Asked
from experiments.kit import Cell, Drawing, Row, Settings, Study, grid, setting, settings
from experiments.tasks.corral import episodes

OPERATIONS = ("removal", "mirror", "distance", "recognition", "interpolation")
READINGS, SHOWN = ("uniform", "driven"), ("same", "own")
MOST_CODEBOOKS = 1000


@dataclass
class Codebooks:
    """Draws of the codebooks for each operation."""

    removal: int = setting(3, "for removal", low=1, high=MOST_CODEBOOKS)
    mirror: int = setting(10, "for mirror images", low=1, high=MOST_CODEBOOKS)
    distance: int = setting(2, "for distance", low=1, high=MOST_CODEBOOKS)
    recognition: int = setting(5, "for recognition", low=1, high=MOST_CODEBOOKS)
    interpolation: int = setting(6, "for the switching weight", low=1, high=MOST_CODEBOOKS)


@dataclass
class Algebra(Settings):
    """The settings of this study."""

    operations: list[str] = setting(list(OPERATIONS), "what is measured", choices=OPERATIONS, distinct=True)
    codebooks: Codebooks = settings(Codebooks, "draws of the codebooks")
    dim: int = setting(4000, "elements of a hypervector; even, since a mirror image is a rotation by half", low=2)
    bins: int = setting(32, "bins per sensor", low=2)
    margin: float = setting(0.5, "lead that counts as correct in error-driven learning, in stored pairs", low=0)
    demonstrations: int = episodes(20, "runs of the teacher to learn from")
    tested: int = setting(200, "held-out runs of the teacher, or of each behaviour to recognise", low=1)
    readings: list[str] = setting(
        list(READINGS), "distance: spread over the sensors' ranges, or from runs", choices=READINGS, distinct=True
    )
    rules: list[str] = setting(list(RULES), "distance: how programs are learned", choices=RULES, distinct=True)
    shown: list[str] = setting(
        list(SHOWN), "distance: whether all learn from the same readings", choices=SHOWN, distinct=True
    )
    variants: int = setting(30, "distance: variants of the teacher; each two are compared", low=3)
    readings_shown: int = setting(300, "distance: readings that each variant learns from", low=1)
    compared: int = setting(4000, "distance: readings on which the variants' rules are compared", low=1)
    behaviours: list[str] = setting(list(EIGHT), "recognition: behaviours to tell apart", choices=EIGHT, distinct=True)
    steps: list[int] = setting([1, 5, 20, 100], "recognition: steps that are seen", low=1, distinct=True)
    sequences: int = setting(4000, "recognition: sequences of steps, of all behaviours together", low=1)
    recognition_demonstrations: int = episodes(100, "recognition: runs of each behaviour to learn from")


def check(settings: Algebra) -> None:
    """Raise for what cannot be measured."""
    if settings.dim % 2:
        raise ValueError(f"dim={settings.dim}: expected an even number")
    if (count := len(settings.behaviours)) > settings.sequences:
        raise ValueError(f"sequences={settings.sequences}: expected at least one for each of {count} behaviours")


def cells(settings: Algebra) -> list[Cell]:
    """A cell for each operation and codebook, for distance also for each way to learn; the longest first."""
    ways = {"readings": settings.readings, "rule": settings.rules, "shown": settings.shown}
    found: list[Cell] = []
    for operation in ("recognition", "distance", "mirror", "interpolation", "removal"):
        if operation in settings.operations:
            factors = ways if operation == "distance" else {}
            codebooks = range(getattr(settings.codebooks, operation))
            found += grid(operation=[operation], **factors, codebook=codebooks)
    return found


def measure(settings: Algebra, cell: Cell) -> list[Row]:
    """What one operation gives with one draw of the codebooks."""
    asked = Asked(settings, MOST_CODEBOOKS * settings.seed + cell["codebook"])
    if cell["operation"] == "distance":
        return operations.distance(asked, cell["readings"], cell["rule"], cell["shown"])
    return MEASURED[cell["operation"]](asked)


MEASURED: dict[str, Callable[[Asked], list[Row]]] = {
    "removal": operations.removal,
    "mirror": operations.mirrored,
    "recognition": operations.recognition,
    "interpolation": operations.interpolation,
}


def summarise(settings: Algebra, records: pd.DataFrame) -> list[Row]:
    """The rows of all operations."""
    table: list[Row] = []
    for operation in settings.operations:
        own = records.loc[records.operation == operation].dropna(axis=1, how="all")
        table += [{"operation": operation, **row} for row in algebra_tables.SUMMARISED[operation](own)]
    return table


METHOD = """
All programs are learned from recorded runs in the arena `default`, error-driven, with level codes joined by a product.

Mirror images: the program learns from the moments in which the lamp is seen on both sides or on the left. Distance:
variants of the teacher have random thresholds of light (1 to 4 m) and obstacles (.1 to .55 m), and label the same
readings; disagreement is the share of held-out readings at which two rules command differently.

Recognition: sequences are random steps of one held-out run. Many steps look alike under several rules; the ceiling is a
uniform choice among the rules that agree with every step. Interpolation: seek is the teacher, flee turns away from
light.
"""
QUICK = {"codebooks": {"removal": 1, "mirror": 2, "distance": 1, "recognition": 1, "interpolation": 2},
         "demonstrations": 6, "tested": 20,
         "variants": 8, "readings_shown": 100, "compared": 500, "sequences": 400, "rules": ["one_shot"],
         "recognition_demonstrations": 10}  # fmt: skip

study = Study(
    name="algebra",
    about="What can be done with behaviours that are vectors?",
    settings=Algebra,
    check=check,
    cells=cells,
    measure=measure,
    summarise=summarise,
    keys=("operation", "readings", "rule", "shown", "program", "steps", "codebook"),
    tables=algebra_tables.tables,
    figures=[
        Drawing(
            "algebra", algebra_figures.operations,
            "recognition, distance and the switching weight, measured and predicted",
            "Recognition beside what the true rules could tell; distance of programs against the disagreement of their "
            "rules, a point for each two; the switching weight, a point for each codebook, beside its prediction.",
        ),
    ],
    headline=algebra_tables.headline,
    method=METHOD,
    presets={"quick": QUICK},
)  # fmt: skip
