"""How many (condition, result) pairs does one hypervector hold?

A robot with 3 sensors of 20 values and 2 actuators of 3 values is shown random pairs, all conditions distinct, and
asked each condition again. A number of pairs is *held* if at least 99 % of them are recalled. Superposing each pair
once, as the paper does, is compared with programs that are trained, and with the closed form for sums of random pairs.

    torchvsa capacity
    torchvsa capacity dims=[500,1000] pairs=[10,100,500] rows=[OneShot_sum,Gradient]
    torchvsa capacity --multirun seed=0,1,2
"""

import time
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from behaviours import Rule, Space
from behaviours.learning import no_convergence_warnings
from experiments.kit import (
    Cell,
    Column,
    Drawing,
    Outcome,
    Part,
    Row,
    Settings,
    Study,
    Table,
    grid,
    part,
    parts,
    setting,
)
from experiments.kit.figures import BLACK, GREY, legend_below, lines
from experiments.tasks.random_pairs import (
    CONDITIONS,
    SCHEMA,
    VALUES,
    expected,
    most_held,
    predicted,
    random_pairs,
    recalled,
)
from experiments.tasks.seeds import seed_of

CLOSED_FORM = "closed_form"
"""The row that is computed and not measured."""


@dataclass
class Codes:
    """How conditions and results are coded; with lookup codes for the sensors, no condition is like another.

    Conditions as products are unrelated without a protection. Balanced results leave no dimension in which all three
    values of an actuator agree, and which could not tell them apart: a quarter of them with random codes.
    """

    record: str = "product"
    protection: dict[str, Any] = field(default_factory=lambda: {"name": "none"})
    results: str = "balanced"


PRINTED = Codes("sum", {"name": "self_shift", "width": "mean"}, "lookup")
EVEN = Codes("sum", {"name": "self_shift", "width": "sum"}, "lookup")


@dataclass
class Learner:
    """One row: its rule, its codes, and the pairs per dimension where its search begins."""

    rule: dict[str, Any] = field(default_factory=lambda: {"name": "one_shot"})
    about: float = 0.02
    codes: Codes = field(default_factory=Codes)


LEARNERS = {
    "literal": Learner({"name": "one_shot", "clip_each_step": True}, 0.005, PRINTED),
    "OneShot_mean": Learner({"name": "one_shot"}, 0.005, PRINTED),
    "OneShot_sum": Learner({"name": "one_shot"}, 0.02, EVEN),
    "OneShot": Learner({"name": "one_shot"}, 0.02),
    "LeastSquares": Learner({"name": "least_squares"}, 0.25),
    # Far fewer epochs than its 200, which would take most of the time; with them it holds some more pairs.
    "ErrorDriven": Learner({"name": "error_driven", "epochs": 40}, 0.4),
    "Gradient_sum": Learner({"name": "gradient", "epochs": 400, "learning_rate": 0.5}, 0.4, EVEN),
    "Gradient": Learner({"name": "gradient", "epochs": 400, "learning_rate": 0.5}, 0.55),
}
ROWS = [name for name in LEARNERS if name != "Gradient_sum"]
CURVE = [10, 25, 50, 100, 200, 400, 800, 1200, 1600, 2000]


@dataclass
class Capacity(Settings):
    """The settings of this study."""

    vsa: Part = part("vsa", "map_c", "the architecture; `dims` replaces its dimension")
    dims: list[int] = setting([500, 1000, 2000, 4000], "dimensions", low=1, distinct=True)
    pairs: list[int] = setting(CURVE, "pairs on the curves at the largest dimension", low=1, high=CONDITIONS)
    until: float = setting(0.6, "a curve ends with the first recall below this", low=0, high=1)
    repeats: int = setting(3, "draws of pairs and codebooks", low=1)
    accuracy: float = setting(0.99, "recall at which a number of pairs counts as held", above=0, below=1)
    precision: float = setting(0.05, "largest gap above the number found, as a share of it", low=0, below=1)
    rows: list[str] = setting(ROWS, "learners, of those below", distinct=True)
    learners: dict[str, Learner] = setting(LEARNERS, "rule, codes and first guess (pairs per dimension) by name")


def check(settings: Capacity) -> None:
    """Raise for rows that do not exist, and for rules that cannot train the architecture's programs."""
    for row in settings.rows:
        if row not in settings.learners:
            raise ValueError(f"rows: there is no {row!r}; choose from {', '.join(settings.learners)}")
        parts.refuse_unsupported(*made(settings, row, max(settings.dims), settings.seed))


def cells(settings: Capacity) -> list[Cell]:
    """A cell for each learner, dimension and repeat; the longest first, so that no process ends up alone with one."""
    found = grid(learner=settings.rows, dim=settings.dims, repeat=range(settings.repeats))
    return sorted(found, key=lambda cell: -settings.learners[cell["learner"]].about * cell["dim"] ** 2)


def made(settings: Capacity, learner: str, dim: int, seed: int) -> tuple[Rule, Space]:
    """The rule and the codebooks of a row."""
    codes = settings.learners[learner].codes
    vsa, encoder, record = {**settings.vsa, "dim": dim}, {"name": "lookup", "bins": VALUES}, {"name": codes.record}
    space = parts.space(SCHEMA, vsa, encoder, record, codes.protection, seed, codes.results)
    return parts.rule(settings.learners[learner].rule), space


def measure(settings: Capacity, cell: Cell) -> list[Row]:
    """Every program that was asked, and the most pairs that are held (`held`, the same in all rows).

    With the largest dimension the numbers of the setting `pairs` are measured first, and the search goes on below the
    first of them that is not held. Numbers after a recall under the setting `until` are left out.
    """
    learner, dim = cell["learner"], cell["dim"]
    seed = seed_of(settings.seed, cell["repeat"])
    rule, space = made(settings, learner, dim, seed)
    rows: list[Row] = []

    @cache
    def recall(count: int) -> float:
        shown = random_pairs(count, seed)
        began = time.perf_counter()
        with no_convergence_warnings():  # the recall says it
            behaviour = rule.fit(space, shown)
        row = {"pairs": count, "seconds": time.perf_counter() - began, "recall": recalled(behaviour, shown)}
        rows.append({**row, "epochs": behaviour.report.epochs, "updates": behaviour.report.updates})
        return row["recall"]

    curve = sorted(settings.pairs) if dim == max(settings.dims) else []
    start = round(settings.learners[learner].about * dim)
    held = most_held(recall, curve, start, settings.accuracy, settings.until, settings.precision)
    return [{**row, "held": held} for row in rows]


def summarise(settings: Capacity, records: pd.DataFrame) -> list[Row]:
    """One row for each learner and dimension, and the closed form below them."""
    table: list[Row] = []
    for cell in grid(learner=settings.rows, dim=settings.dims):
        own = records[(records.learner == cell["learner"]) & (records.dim == cell["dim"])]
        held = own.groupby("repeat").held.first()
        pairs = {"pairs": held.median(), "pairs_min": held.min(), "pairs_max": held.max()}
        seconds = own.loc[own.pairs == own.held, "seconds"].median()  # of the programs that held the most
        table.append({**cell, **pairs, "pairs_per_dim": held.median() / cell["dim"], "seconds": seconds})
    for dim in settings.dims:
        pairs = predicted(dim, settings.accuracy)
        table.append({"learner": CLOSED_FORM, "dim": dim, "pairs": float(pairs), "pairs_per_dim": pairs / dim})
    return table


def metrics(settings: Capacity, records: pd.DataFrame, table: list[Row]) -> dict[str, float | None]:
    """The recall of the numbers of pairs on the curves, median over the repeats."""
    dim = max(settings.dims)
    curve = records.loc[(records.dim == dim) & records.pairs.isin(settings.pairs)]
    shares = dict(curve.groupby(["learner", "pairs"]).recall.median())
    shares |= {(CLOSED_FORM, pairs): expected(dim, pairs) for pairs in settings.pairs}
    return {f"{learner}.{dim}.recall_of_{pairs}": share for (learner, pairs), share in shares.items()}


def headline(outcome: Outcome) -> str:
    """What the largest dimension holds."""
    dim = max(outcome.settings.dims)
    found = sorted((row for row in outcome.table if row["dim"] == dim), key=lambda row: -row["pairs"])
    return f"With d = {dim:,}: " + ", ".join(f"`{row['learner']}` {row['pairs']:,.0f}" for row in found) + " pairs."


def curves(outcome: Outcome) -> Figure:
    """Recall against the number of pairs with the largest dimension, and pairs held against the dimension."""
    settings, dim, records = outcome.settings, max(outcome.settings.dims), outcome.records
    figure = Figure(figsize=(10.5, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    curve = records.loc[(records.dim == dim) & records.pairs.isin(settings.pairs)]
    lines(left, curve, "pairs", "recall", "learner", order=settings.rows)
    held = records.drop_duplicates(["learner", "dim", "repeat"])
    lines(right, held, "dim", "held", "learner", order=settings.rows)
    closed = pd.DataFrame([row for row in outcome.table if row["learner"] == CLOSED_FORM])
    right.plot(closed.dim, closed.pairs, ":", color=BLACK, zorder=5)
    shown = np.geomspace(min(settings.pairs), max(settings.pairs), 80).round().astype(int).tolist()
    left.plot(shown, [expected(dim, pairs) for pairs in shown], ":", color=BLACK, zorder=5, label="closed form")
    left.axhline(settings.accuracy, color=GREY, linewidth=0.8)
    left.set(xscale="log", xlabel="pairs shown", ylabel="share of pairs recalled", title=f"recall with d = {dim:,}")
    left.set_ylim(settings.until - 0.08, 1.02)
    right.set(yscale="log", xlabel="dimensions d", ylabel=f"pairs recalled at {settings.accuracy:.0%}")
    right.set_xscale("log", base=2)
    right.set_xticks(settings.dims, [f"{d:,}" for d in settings.dims])
    legend_below(figure, left, 9)
    return figure


TABLE = Table(
    "Pairs held by one hypervector",
    [
        Column("learner"),
        Column("dim", "d"),
        Column("pairs", "pairs held", ",.0f", ("pairs_min", "pairs_max"), about="median [least, most]"),
        Column("pairs_per_dim", format=".3f"),
        Column("seconds", "training (s)", ".2f", about="median time of one thread for that many"),
    ],
)
METHOD = """
One program is taught random pairs of a condition and one of 9 results; a pair is recalled if both commands are. Each
repeat draws its own pairs and codebooks; fewer pairs are the first of more. The number held is searched: from a guess
up or down by a quarter until one number holds and one fails (with the largest dimension: along the numbers of the
curve), then by halving until they are within `precision`. The smaller one is reported.

The closed form is that of a raw sum of pairs whose conditions are unrelated, asked for the two values of its results
one by one (MAP-I, 2k bound values for k pairs, the best of 3, both to be right). Of the rows, `OneShot_sum` is nearest
to that; conditions that share a shift width resemble each other, which is rare there and common in `OneShot_mean`. The
results of `OneShot` are spaced farther apart than random ones. The closed form says when the mean recall passes the
line; below 100 pairs 99 % means all of one draw, which may be lucky.
"""
FIGURE = Drawing(
    "capacity",
    curves,
    "recall against the number of pairs, and pairs held against the dimension",
    "Lines: median over the repeats. Bands: lowest to highest. Dotted: the closed form. A curve on the left "
    "ends with the first recall below `until`.",
)
QUICK = {"dims": [250, 500], "pairs": [10, 50, 200], "rows": ["OneShot_sum", "OneShot", "ErrorDriven"]}

study = Study(
    name="capacity",
    about="How many (condition, result) pairs does one hypervector hold?",
    settings=Capacity,
    check=check,
    cells=cells,
    measure=measure,
    summarise=summarise,
    keys=("learner", "dim"),
    metrics=metrics,
    table=TABLE,
    figures=[FIGURE],
    headline=headline,
    method=METHOD,
    presets={"quick": QUICK},
)
