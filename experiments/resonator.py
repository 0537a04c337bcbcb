"""How large a set of products does a resonator network factor?

Products of one item from each of F codebooks of K random items of -1 / +1 are factored, K^F products in all. The
largest K with 99 % right is searched, the operational capacity, and compared with what Kent et al. 2020 measured. The
stochastic variant is that of Langenegger et al. 2023.

    torchvsa resonator
    torchvsa resonator dims=[1000] factors=[2] variants=[plain]
"""

import time
from dataclasses import dataclass
from functools import cache, reduce
from typing import Any

import pandas as pd
import torch
from matplotlib.figure import Figure

from experiments.kit import Cell, Column, Drawing, Outcome, Row, Settings, Study, Table, grid, setting
from experiments.kit.figures import BLACK, legend_below, lines
from experiments.tasks.random_pairs import bracket, halve
from experiments.tasks.seeds import generator_of
from torchvsa import MAP, Resonator

PUBLISHED = {
    2: {1000: 340, 1500: 600, 2000: 828},
    3: {1500: 79, 2000: 128, 3000: 205},
    4: {2000: 41, 3000: 56, 4000: 67},
}
"""Items per codebook, from `operational_capacity.yaml` in github.com/spencerkent/resonator-networks, the authors' code
of Kent et al. 2020 (outer product weights, accuracy .99, .001 K^F iterations)."""

VARIANTS: dict[str, dict[str, Any]] = {"plain": {}, "stochastic": {"noise": 0.5, "threshold": 1.5}}
GUESS = {2: 0.3, 3: 0.05, 4: 0.018}
"""Items per element of a hypervector where the search begins."""


@dataclass
class Resonators(Settings):
    """The settings of this study."""

    dims: list[int] = setting([250, 500, 1000, 1500], "dimensions", low=16, distinct=True)
    factors: list[int] = setting([2, 3, 4], "factors", choices=[2, 3, 4], distinct=True)
    variants: list[str] = setting(list(VARIANTS), "networks", choices=VARIANTS, distinct=True)
    stochastic_to: int = setting(500, "the largest dimension of the stochastic variant, which takes longest", low=0)
    accuracy: float = setting(0.99, "share of products to be factored", above=0, below=1)
    trials: int = setting(200, "products per codebook size", low=1)
    draws: int = setting(4, "draws of the codebooks among them", low=1)
    steps: int = setting(1000, "the largest number of steps", low=1)
    precision: float = setting(0.05, "largest gap above the size found, as a share of it", low=0, below=1)


def cells(settings: Resonators) -> list[Cell]:
    """A cell for each variant, number of factors and dimension; the longest first."""
    found = grid(variant=settings.variants, factors=settings.factors, dim=settings.dims)
    found = [cell for cell in found if cell["variant"] == "plain" or cell["dim"] <= settings.stochastic_to]
    return sorted(found, key=lambda cell: (-cell["factors"], -cell["dim"]))


def share(settings: Resonators, cell: Cell, size: int) -> float:
    """The share of products that are factored; an upper bound of it once it is below the accuracy for certain."""
    factors, vsa = cell["factors"], MAP(cell["dim"], dtype=torch.int8)
    generator = generator_of(settings.seed, factors, cell["dim"], size)
    wrong, each = 0, -(-settings.trials // settings.draws)
    for _ in range(settings.draws):
        books = vsa.random(factors, size, generator=generator).unbind(0)
        index = torch.randint(size, (each, factors), generator=generator)
        bound = reduce(vsa.bind, [book[column] for book, column in zip(books, index.unbind(1), strict=True)])
        found = Resonator(vsa, books, steps=settings.steps, **VARIANTS[cell["variant"]])(bound, generator)
        wrong += int((found.indices != index).any(1).sum())
        if 1 - wrong / (each * settings.draws) < settings.accuracy:
            break
    return 1 - wrong / (each * settings.draws)


def measure(settings: Resonators, cell: Cell) -> Row:
    """The largest codebooks that are factored, and the seconds of the search."""
    began = time.perf_counter()

    @cache
    def holds(size: int) -> bool:
        return share(settings, cell, size) >= settings.accuracy

    start = max(round(GUESS[cell["factors"]] * cell["dim"]), 2)
    size = halve(holds, *bracket(holds, start, 1, 10 * cell["dim"]), settings.precision)
    return {"size": size, "seconds": time.perf_counter() - began}


def summarise(settings: Resonators, records: pd.DataFrame) -> list[Row]:
    """A row for each cell, with the published size, and the gain of the stochastic variant in products."""
    table: list[Row] = []
    plain = {
        (row["factors"], row["dim"]): int(row["size"])
        for row in records.to_dict("records")
        if row["variant"] == "plain"
    }
    for cell in grid(variant=settings.variants, factors=settings.factors, dim=settings.dims):
        own = records[(records.variant == cell["variant"]) & (records.factors == cell["factors"])]
        for size in own.loc[own.dim == cell["dim"], "size"]:
            row = {**cell, "size": int(size), "products": float(size) ** cell["factors"]}
            if cell["variant"] == "plain":
                row["published"] = PUBLISHED[cell["factors"]].get(cell["dim"])
            elif (base := plain.get((cell["factors"], cell["dim"]), 1)) > 1:  # nothing was factored with one item
                row["gain"] = (float(size) / base) ** cell["factors"]
            table.append(row)
    return table


def headline(outcome: Outcome) -> str:
    """Ours beside the published sizes."""
    known = [row for row in outcome.table if row.get("published")]
    pairs = [f"{row['size']} ({row['published']}) for F = {row['factors']}, d = {row['dim']:,}" for row in known]
    return f"Items per codebook, measured (published): {'; '.join(pairs)}." if pairs else ""


def curves(outcome: Outcome) -> Figure:
    """The number of products against the dimension, with the published points."""
    figure = Figure(figsize=(3.4 * len(outcome.settings.factors) + 0.6, 3.6), layout="constrained")
    panels = figure.subplots(1, len(outcome.settings.factors), squeeze=False)[0]
    frame = pd.DataFrame(outcome.table)
    for factors, axes in zip(outcome.settings.factors, panels, strict=True):
        own = frame.loc[frame.factors == factors]
        lines(axes, own, "dim", "products", "variant", order=outcome.settings.variants)
        dims, sizes = zip(*PUBLISHED[factors].items(), strict=True)
        axes.plot(dims, [float(size) ** factors for size in sizes], "x", color=BLACK, label="Kent et al. 2020")
        axes.set(xscale="log", yscale="log", xlabel="dimensions d", ylabel="products", title=f"{factors} factors")
        ticks = sorted({*own.dim, *dims})[::2]  # every other one, so that the labels have room
        axes.set_xticks(ticks, [f"{dim:,}" for dim in ticks])
        axes.minorticks_off()
    legend_below(figure, panels[0], 3)
    return figure


TABLE = Table(
    "Operational capacity of resonator networks",
    [
        Column("variant"),
        Column("factors", "F"),
        Column("dim", "d", ","),
        Column("size", "items per codebook", ","),
        Column("published", format=",", about="Kent et al. 2020, outer product weights"),
        Column("products", format=",.0f"),
        Column("gain", format=".1f", about="products compared with the plain network"),
    ],
)
METHOD = """
Codebooks are random, of equal size. A product counts as factored if all items are right. The size is searched: from a
guess up or down by a quarter until one size holds and one fails, then by halving until they are within `precision`; the
smaller is reported. Both variants have the same limit of steps; the published one is .001 K^F, which is less below
a million products and more above.
"""
FIGURE = Drawing("resonator", curves, "products that are factored against d, for each number of factors")
QUICK = {"dims": [100, 200], "factors": [2, 3], "trials": 40, "draws": 2, "precision": 0.2, "steps": 400}

study = Study(
    name="resonator",
    about="How large a set of products does a resonator network factor?",
    settings=Resonators,
    cells=cells,
    measure=measure,
    summarise=summarise,
    keys=("variant", "factors", "dim"),
    table=TABLE,
    figures=[FIGURE],
    headline=headline,
    method=METHOD,
    presets={"quick": QUICK},
)
