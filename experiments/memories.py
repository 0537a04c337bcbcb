"""Which memory cleans up best: a table of the items, or a network that completes the query?

Random items of -1 / +1 are stored; a query is an item with a share of its elements flipped. The table, `CleanUp`,
finds the most similar item, which is the most probable one; the networks complete the query first.

    torchvsa memories
    torchvsa memories dim=2000 items=[10,1000] memories=[clean_up,hopfield]
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import pandas as pd
import torch
from matplotlib.figure import Figure

from experiments.kit import Cell, Column, Drawing, Outcome, Row, Settings, Study, Table, aggregated, grid, setting
from experiments.kit.figures import legend_below, lines
from experiments.tasks.seeds import generator_of
from torchvsa import MAP, ClassicalHopfield, CleanUp, Hopfield, SparseDistributedMemory

MEMORIES: dict[str, Callable[..., CleanUp]] = {
    "clean_up": CleanUp,
    "hopfield": Hopfield,
    "outer_product": ClassicalHopfield,
    "asynchronous": partial(ClassicalHopfield, order="asynchronous", steps=5),
    "projection": partial(ClassicalHopfield, rule="projection"),
    "sparse_distributed": SparseDistributedMemory,
}


@dataclass
class Memories(Settings):
    """The settings of this study."""

    dim: int = setting(1000, "elements of an item", low=2)
    items: list[int] = setting([10, 30, 100, 300, 900], "items stored", low=2, distinct=True)
    noise: list[float] = setting([0.1, 0.2, 0.3, 0.4, 0.45], "share of elements flipped", low=0, high=1, distinct=True)
    memories: list[str] = setting(list(MEMORIES), "memories", choices=MEMORIES, distinct=True)
    queries: int = setting(100, "queries per draw", low=1)
    repeats: int = setting(2, "draws of items and queries", low=1)


def check(settings: Memories) -> None:
    """Raise for more items than the projection rule holds."""
    if "projection" in settings.memories and max(settings.items) > settings.dim:
        raise ValueError(f"items={max(settings.items)}: the projection rule holds at most dim={settings.dim}")


def cells(settings: Memories) -> list[Cell]:
    """A cell for each memory, number of items and repeat; the slow ones first."""
    slow = ["asynchronous", "sparse_distributed"]
    names = sorted(settings.memories, key=lambda name: name not in slow)
    return grid(memory=names, items=sorted(settings.items, reverse=True), repeat=range(settings.repeats))


def measure(settings: Memories, cell: Cell) -> list[Row]:
    """For each share of noise: accuracy, similarity of the completed state with the right item, time, bytes."""
    generator = generator_of(settings.seed, cell["items"], cell["repeat"])
    items = MAP(settings.dim, dtype=torch.int8).random(cell["items"], generator=generator)
    memory = MEMORIES[cell["memory"]](items)
    size = sum(tensor.nbytes for tensor in memory.state_dict().values())
    rows = []
    for noise in settings.noise:
        index = torch.randint(len(items), (settings.queries,), generator=generator)
        flipped = torch.rand(settings.queries, settings.dim, generator=generator) < noise
        queries = torch.where(flipped, -items[index], items[index])
        began = time.perf_counter()
        match = memory(queries)
        seconds = time.perf_counter() - began
        states: Any = getattr(memory, "retrieve", lambda asked, match=match: items[match.index])(queries)
        completed = torch.cosine_similarity(states.double(), items[index].double()).mean()
        right = (match.index == index).double().mean()
        row = {"noise": noise, "accuracy": float(right), "completed": float(completed)}
        rows.append({**row, "query_us": 1e6 * seconds / settings.queries, "bytes": size})
    return rows


def summarise(settings: Memories, records: pd.DataFrame) -> list[Row]:
    """A row for each memory, number of items and share of noise."""
    columns = {name: (name, "mean") for name in ("accuracy", "completed", "bytes")}
    order = grid(memory=settings.memories, items=settings.items, noise=settings.noise)
    return aggregated(records, ("memory", "items", "noise"), {**columns, "query_us": ("query_us", "median")}, order)


def headline(outcome: Outcome) -> str:
    """How often a network beat the table."""
    table = {(row["items"], row["noise"]): row for row in outcome.table if row["memory"] == "clean_up"}
    if not table:
        return ""
    others = [row for row in outcome.table if row["memory"] != "clean_up"]
    better = sum(row["accuracy"] > table[row["items"], row["noise"]]["accuracy"] for row in others)
    faster = sum(row["query_us"] < table[row["items"], row["noise"]]["query_us"] for row in others)
    return (
        f"Of {len(others)} comparisons with the table, a network is more accurate in {better} and faster in {faster}."
    )


def curves(outcome: Outcome) -> Figure:
    """Accuracy and the similarity of the completed state against the noise, a column per number of items."""
    settings, frame = outcome.settings, pd.DataFrame(outcome.table)
    figure = Figure(figsize=(2.6 * len(settings.items) + 1, 5), layout="constrained")
    panels = figure.subplots(2, len(settings.items), sharey="row", sharex=True, squeeze=False)
    for column, count in enumerate(settings.items):
        for line, measured in enumerate(("accuracy", "completed")):
            axes = panels[line][column]
            own = frame.loc[frame["items"] == count]
            lines(axes, own, "noise", measured, "memory", order=settings.memories)
            axes.set(xlabel="flipped" if line else "", title="" if line else f"{count:,} items")
            axes.set_ylabel(("share right", "similarity of the completed state")[line])
    legend_below(figure, panels[0][0], 6)
    return figure


TABLE = Table(
    "Memories compared with the table",
    [
        Column("memory"),
        Column("items", format=","),
        Column("noise", "flipped", ".2f"),
        Column("accuracy", format=".3f"),
        Column("completed", format=".3f", about="cosine of the completed state with the right item"),
        Column("query_us", "µs per query", ".0f", about="one thread, in a batch of `queries`"),
        Column("bytes", format=",.0f", about="all tensors of the memory"),
    ],
)
METHOD = """
Items are random; a query is an item with each element flipped with the given probability. All memories answer the same
queries. The completed state of the table is the item that it found. Queries are asked in one batch.
"""
FIGURE = Drawing("memories", curves, "accuracy and completed state against the noise, for each number of items")
QUICK = {"dim": 300, "items": [10, 100], "noise": [0.1, 0.3], "queries": 30, "repeats": 1}

study = Study(
    name="memories",
    about="Which memory cleans up best: a table of the items, or a network that completes the query?",
    settings=Memories,
    check=check,
    cells=cells,
    measure=measure,
    summarise=summarise,
    keys=("memory", "items", "noise"),
    table=TABLE,
    figures=[FIGURE],
    headline=headline,
    method=METHOD,
    presets={"quick": QUICK},
)
