"""How many dimensions does each architecture need for k vectors in one, by the protocol of a published comparison?

Items are bundled, and found again as the nearest ones to their bundle; or pairs are bound, bundled, and unbound again.
For each k the least number of dimensions is measured with which 99 % are found among 1,000 items. A line through these
numbers is compared with the published one and with the closed forms. Besides, a hypervector is bound with several keys
and unbound again.

    torchvsa dimensions
    torchvsa dimensions architectures=[HRR,FHRR] counts=[5,15,25]
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
import torch

from experiments.capacity import dimension_figures, dimension_tables, protocol
from experiments.capacity.crossing import crossing, first_at, window
from experiments.kit import Cell, Drawing, Row, Settings, Study, grid, setting
from experiments.tasks.seeds import generator_of

GRID = [m * m for m in (*range(2, 41), *range(42, 102, 2))]
"""Squares, since VTB allows no other numbers: all up to 1,600, then those of even numbers."""
PUBLISHED_GRID = {m * m for m in range(2, 42, 2)}
"""The numbers of dimensions of the published measurements."""
FLOOR = 0.92
"""Accuracy down to which dimensions are measured: with it, the crossing of a curve that follows a closed form is found
within 1.5 %."""
PER_VECTOR = 32
"""Dimensions for each vector with which the search begins; those of MAP-I."""


@dataclass
class Dimensions(Settings):
    """The settings of this study."""

    architectures: list[str] = setting(
        [], "what is measured; none named: all that are known", choices=protocol.names, distinct=True, empty=True
    )
    counts: list[int] = setting(list(range(3, 52, 2)), "numbers k of vectors in one", low=1, distinct=True)
    items: int = setting(1000, "items that an answer is one of", low=2)
    repeats: int = setting(10, "draws for each number of dimensions", low=1)
    accuracy: float = setting(0.99, "share to be found", above=FLOOR, below=1)
    keys: int = setting(10, "keys that a hypervector is bound with, one after the other", low=1)
    keys_dim: int = setting(1024, "elements of that hypervector", low=1)


def check(settings: Dimensions) -> None:
    """Raise for more vectors in one than there are items, and for a single number of them, which gives no line."""
    if (most := max(settings.counts)) > settings.items:
        raise ValueError(f"counts={most}: expected at most items={settings.items}")
    if len(settings.counts) < 2:
        raise ValueError(f"counts={settings.counts}: a line needs at least 2 numbers")


def measured(settings: Dimensions) -> list[str]:
    """The architectures that are measured."""
    return settings.architectures or protocol.names()


def cells(settings: Dimensions) -> list[Cell]:
    """A cell for each k, task and architecture, the largest k first; then those of repeated unbinding."""
    found = grid(k=sorted(settings.counts, reverse=True), task=list(protocol.TASKS), architecture=measured(settings))
    return found + grid(task=[protocol.UNBINDING], architecture=measured(settings))


def measure(settings: Dimensions, cell: Cell) -> list[Row]:
    """A row for each number of dimensions around the one that is needed; or for each draw and number of keys."""
    name, task = cell["architecture"], cell["task"]
    if task == protocol.UNBINDING:
        return unbinding(settings, name)
    k, dims = cell["k"], {}

    def accuracy(place: int) -> float:
        vsa = protocol.nearest_allowed(name, GRID[place])
        dims[place] = vsa.dim
        draws = [generator(settings, name, task, k, vsa.dim, repeat) for repeat in range(settings.repeats)]
        return float(np.mean([protocol.TASKS[task](vsa, k, settings.items, draw) for draw in draws]))

    start = int(np.abs(np.array(GRID) - PER_VECTOR * k).argmin())
    shares = window(accuracy, start, settings.accuracy, FLOOR, len(GRID) - 1)
    needed = crossing({dims[place]: share for place, share in shares.items()}, settings.repeats * k, settings.accuracy)
    published = {GRID[place]: share for place, share in shares.items() if GRID[place] in PUBLISHED_GRID}
    found = {"needed": needed, "first": first_at(published, settings.accuracy)}
    return [{"dim": dims[place], "accuracy": share, **found} for place, share in shares.items()]


def unbinding(settings: Dimensions, name: str) -> list[Row]:
    """A row for each draw and number of keys, which is its `k`."""
    vsa, rows = protocol.nearest_allowed(name, settings.keys_dim), []
    for repeat in range(settings.repeats):
        similar = protocol.returned(vsa, settings.keys, generator(settings, name, protocol.UNBINDING, repeat))
        rows += [{"k": keys, "dim": vsa.dim, "similarity": one} for keys, one in enumerate(similar, 1)]
    return rows


def generator(settings: Dimensions, *factors: object) -> torch.Generator:
    """Random numbers of their own for each combination of factors."""
    return generator_of(settings.seed, *(zlib.crc32(repr(factor).encode()) for factor in factors))


METHOD = """
A bundle of k of the items: the k items that are most similar to it are its members, or not. k pairs of a role and an
item, bundled: each role is unbound, and the most similar item is its own, or not. All vectors are drawn anew, all k are
bundled in one step, which is normalised once, and each number of dimensions has 10 draws. Dimensions are squares, or
the nearest numbers that the architecture allows: from the first with an accuracy below .92 to the second in a row with
at most half of the errors allowed.

`d needed` is where the accuracy crosses the line: the errors of all measured dimensions are fitted as Poisson with a
mean that is linear in log-log scale. `First on the grid` is the rule of the published measurements: the first of the
squares of even numbers up to 1,600 with a mean accuracy of .99; those squares are 15 % apart near 750, so that a number
is rounded up by half of that on the average, and a lucky draw takes an earlier one. A k that none of them is enough for
is left out. The line through either is fitted by least squares.

The closed forms (`torchvsa.dim_needed`) are those of one-shot sums of independent random hypervectors.
"""

study = Study(
    name="dimensions",
    about="How many dimensions does each architecture need for k vectors in one, and how does it compare?",
    settings=Dimensions,
    check=check,
    cells=cells,
    measure=measure,
    summarise=lambda settings, records: dimension_tables.summarise(settings, records, measured(settings)),
    keys=("task", "architecture"),
    tables=dimension_tables.tables,
    figures=[
        Drawing(
            "dimensions",
            dimension_figures.lines,
            "dimensions needed against k, a panel for each architecture: measured, fitted, published, closed form",
            "Points: the dimensions at which 99 % are found. Solid: the line through them. Dashed: the published line. "
            "Dotted: the closed form, where there is one.",
        )
    ],
    headline=dimension_tables.headline,
    method=METHOD,
    presets={"quick": {"counts": [5, 15, 25], "repeats": 5}},
)
