"""How many behaviours fit into one vector, and what do their contradictions cost?

Banks of 1 to 256 random behaviours of 20 pairs each are put into one vector: as their plain sum, or each bound to a
context. Every pair is asked again, and recall is compared with what theory predicts from the number of pairs.

    torchvsa scale
    torchvsa scale dims=[2000] sizes=[1,8,64] contradicting=[]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import pandas as pd
import torch

from experiments.composition import scale_figures
from experiments.kit import Cell, Column, Drawing, Outcome, Row, Settings, Study, Table, aggregated, grid, setting
from experiments.tasks import random_behaviours as task
from torchvsa import recall_probability

if TYPE_CHECKING:
    from collections.abc import Sequence

RULES = ("one_shot", "trained")
VECTORS = ("bundled", "gated")
RECALLS = [f"{rule}_{how}" for rule in RULES for how in (*VECTORS, "predicted")]
"""The columns of recall."""
MOST_CODEBOOKS = 1000


@dataclass
class Scale(Settings):
    """The settings of this study."""

    dims: list[int] = setting([1000, 4000, 16_000, 64_000], "elements of a hypervector", low=1, distinct=True)
    sizes: list[int] = setting(
        [1, 2, 4, 8, 16, 32, 64, 128, 256], "behaviours in one vector; they divide the largest number", low=1,
        high=2 * task.DISTINCT, distinct=True,
    )  # fmt: skip
    codebooks: int = setting(5, "draws of codebooks and behaviours", low=1, high=MOST_CODEBOOKS)
    contradicting: list[int] = setting(
        [2, 3, 8], "behaviours in one vector that contradict each other", low=1, distinct=True, empty=True
    )
    contradicting_dim: int = setting(4000, "elements of the hypervector of those", low=1)
    contradicting_codebooks: int = setting(20, "draws of codebooks for those", low=1, high=MOST_CODEBOOKS)
    contradicting_queries: int = setting(20_000, "pairs asked of those for each number, at least", low=1)


def check(settings: Scale) -> None:
    """Raise for sizes that do not divide the largest one: a bank of that many is split into smaller ones."""
    for size in settings.sizes:
        if max(settings.sizes) % size:
            raise ValueError(f"sizes={size} does not divide the largest size, {max(settings.sizes)}")


def cells(settings: Scale) -> list[Cell]:
    """A cell for each dimension and codebook, the largest dimension first; then those with contradictions."""
    dims = sorted(settings.dims, reverse=True)
    found = grid(kind=["distinct"], dim=dims, codebook=range(settings.codebooks))
    if settings.contradicting:
        dims, codebooks = [settings.contradicting_dim], range(settings.contradicting_codebooks)
        found += grid(kind=["contradicting"], dim=dims, codebook=codebooks)
    return found


def measure(settings: Scale, cell: Cell) -> list[Row]:
    """A row of recall and predictions for each number of behaviours in one vector."""
    seed = MOST_CODEBOOKS * settings.seed + cell["codebook"]
    if cell["kind"] == "distinct":
        return distinct(cell["dim"], seed, settings.sizes)
    # As many banks from each codebook as it takes.
    codebooks = settings.contradicting_codebooks
    found = []
    for size in settings.contradicting:
        banks = -(-settings.contradicting_queries // (codebooks * size * task.PAIRS))
        found.append(contradicting(cell["dim"], seed, size, banks))
    return found


def distinct(dim: int, seed: int, sizes: Sequence[int]) -> list[Row]:
    """Recall of banks of up to 128 behaviours that share no condition, and of larger ones, beside its prediction.

    One-shot recall is predicted by `recall_probability("MAP-I", d, 20 b, 9)`, that of trained programs by `predicted`.
    """
    count = max(sizes)
    shown = task.EncodedPairs.of(dim, seed, *task.behaviours(count, seed))
    contexts = task.contexts_for(count, dim, seed)
    programs = {"one_shot": task.one_shot(shown), "trained": task.trained(shown)}
    own, squares = task.scores(shown, programs["trained"]), programs["trained"].double().square().sum(1)
    found = []
    for size in sizes:
        row: Row = {"behaviours": size, "queries": count * task.PAIRS}
        for rule, made in programs.items():
            row[f"{rule}_bundled"] = task.recall(task.scores(shown, task.together(made, size)), shown.results)
            gated = task.scores(shown, task.together(made, size, contexts))
            row[f"{rule}_gated"] = task.recall(gated, shown.results)
        row["one_shot_predicted"] = recall_probability("MAP-I", dim, task.PAIRS * size, task.RESULTS)
        row["trained_predicted"] = task.predicted(own, shown.results, squares, size)
        found.append(row)
    return found


def contradicting(dim: int, seed: int, size: int, banks: int) -> Row:
    """Recall of `banks` times `size` behaviours that contradict each other, each asked for its own results.

    A count of votes predicts that the result of most behaviours wins, ties at random.
    """
    drawn = [task.contradicting(size, seed * banks + bank) for bank in range(banks)]
    asked, results = (torch.cat(part) for part in zip(*drawn, strict=True))
    shown = task.EncodedPairs.of(dim, seed, asked, results)
    contexts = task.contexts_for(len(asked), dim, seed)
    row: Row = {"behaviours": size, "queries": len(asked) * task.PAIRS}
    row["votes"] = sum(task.votes(*bank) for bank in drawn) / banks
    for rule, made in (("one_shot", task.one_shot(shown)), ("trained", task.trained(shown))):
        row[f"{rule}_bundled"] = task.recall(task.scores(shown, task.together(made, size)), results)
        row[f"{rule}_gated"] = task.recall(task.scores(shown, task.together(made, size, contexts)), results)
    return row


def summarise(settings: Scale, records: pd.DataFrame) -> list[Row]:
    """A row for each kind, dimension and number of behaviours: means over the codebooks, and all queries."""
    names = [name for name in (*RECALLS, "votes") if name in records]
    columns = {"queries": ("queries", "sum"), **{name: (name, "mean") for name in names}}
    order = grid(kind=["distinct"], dim=settings.dims, behaviours=settings.sizes)
    order += grid(kind=["contradicting"], dim=[settings.contradicting_dim], behaviours=settings.contradicting)
    rows = aggregated(records, ["kind", "dim", "behaviours"], columns, order)
    return [{key: value for key, value in row.items() if value == value} for row in rows]  # what a kind has


def metrics(settings: Scale, records: pd.DataFrame, table: list[Row]) -> dict[str, float]:
    """The largest difference between recall and its prediction, for banks without contradictions."""
    rows = [row for row in table if row["kind"] == "distinct" and row["behaviours"] <= task.DISTINCT]
    return {
        f"{rule}.largest_difference": max(
            abs(row[f"{rule}_{how}"] - row[f"{rule}_predicted"]) for row in rows for how in VECTORS
        )
        for rule in RULES
        if rows
    }


def headline(outcome: Outcome) -> str:
    """How far recall is from its prediction."""
    found = {rule: outcome.metrics.get(f"{rule}.largest_difference") for rule in RULES}
    if None in found.values():
        return ""
    return (
        f"b behaviours of {task.PAIRS} pairs in one vector are recalled like {task.PAIRS}·b pairs: up to b = "
        f"{task.DISTINCT}, at every d, the largest difference from the prediction is {found['one_shot']:.3f} for "
        f"programs superposed once and {found['trained']:.3f} for trained ones."
    )


def tables(outcome: Outcome) -> list[Table]:
    """A table for each kind."""
    return [
        table.show(rows)
        for kind, table in TABLES.items()
        if (rows := [row for row in outcome.table if row["kind"] == kind])
    ]


KEYS = [Column("dim", "d"), Column("behaviours", "behaviours b"), Column("queries", about="pairs asked")]
BUNDLED, GATED = "asked of the plain sum", "asked of the sum of programs that are each bound to a context"
TABLES = {
    "distinct": Table(
        "Recall of all pairs, by the number of behaviours in one vector",
        [
            *KEYS,
            Column("one_shot_bundled", "one-shot: bundled", ".3f", about=f"each pair superposed once; {BUNDLED}"),
            Column("one_shot_gated", "gated", ".3f", about=GATED),
            Column("one_shot_predicted", "predicted", ".3f", about="by the closed form for 20 b random pairs"),
            Column("trained_bundled", "trained: bundled", ".3f", about="error-driven with a margin of 5 pairs"),
            Column("trained_gated", "gated", ".3f"),
            Column("trained_predicted", "predicted", ".3f", about="from each program's own scores and all lengths"),
        ],
    ),
    "contradicting": Table(
        "Recall of behaviours that contradict each other",
        [
            *KEYS,
            Column("votes", "count of votes", ".3f", about="expected if the result of most behaviours wins"),
            Column("one_shot_bundled", "one-shot: bundled", ".3f"),
            Column("one_shot_gated", "gated", ".3f"),
            Column("trained_bundled", "trained: bundled", ".3f"),
            Column("trained_gated", "gated", ".3f"),
        ],
    ),
}
METHOD = f"""
A behaviour has {task.PAIRS} random conditions of 3 sensors of {task.VALUES} values each (lookup codes joined by a
product) with random results out of {task.RESULTS} independent ones. There are 4,096 conditions: up to
{task.DISTINCT} behaviours share none, while in banks of 256 most conditions are shared, with different results.

The largest bank is drawn once from each codebook, and split into banks of each size; all its pairs are asked at every
size. Programs superposed once are predicted by the closed form for a sum of 20 b random pairs (MAP-I; Frady, Kleyko and
Sommer 2018). Trained ones are predicted from the scores that each program gives to its own pairs: the others add
normal noise, whose variance is the sum of their squared lengths.

Behaviours that contradict each other all draw their conditions from the same {task.POOL}. Each is asked for its own
result.
"""
QUICK = {"dims": [500, 2000], "sizes": [1, 4, 16, 64], "codebooks": 2, "contradicting_codebooks": 2,
         "contradicting_queries": 2000}  # fmt: skip

study = Study(
    name="scale",
    about="How many behaviours fit into one vector, and what do their contradictions cost?",
    settings=Scale,
    check=check,
    cells=cells,
    measure=measure,
    summarise=summarise,
    keys=("kind", "dim", "behaviours"),
    metrics=metrics,
    tables=tables,
    figures=[
        Drawing(
            "scale", scale_figures.recall, "recall against the number of behaviours, a colour for each dimension",
            "Points are measured, lines predicted (solid: superposed once; dotted: trained). Beyond the vertical line "
            "there are more pairs than conditions, so that bundled behaviours contradict each other.",
        ),
        Drawing(
            "contradictions", scale_figures.contradictions,
            "recall of contradicting behaviours, and a count of votes",
            "In a sum the result of most behaviours wins; contexts keep them apart.",
        ),
    ],
    headline=headline,
    method=METHOD,
    presets={"quick": QUICK},
)  # fmt: skip
