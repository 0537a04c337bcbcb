"""The table of a benchmark on the terminal, and as a figure."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from behaviours.storage import write_atomically

WIDTH = 160
"""Of the tables in a file."""
Row = dict[str, Any]


@dataclass(frozen=True)
class _Table:
    """What is shown on the terminal, and in a page between two marks."""

    mark: str
    title: str
    columns: Mapping[str, Literal["left", "right"]]
    cells: list[list[str]]


def print_rows(rows: Sequence[Row], console: Console) -> None:
    """Ratios to the peers, then exponents of growth, then fits with their accuracy."""
    for shown in _tables(rows):
        table = Table(title=shown.title)
        for name, side in shown.columns.items():
            table.add_column(name, justify=side)
        for cells in shown.cells:
            table.add_row(*cells)
        console.print(table)


def fill(page: Path, rows: Sequence[Row]) -> None:
    """Write the tables of a page anew, between their marks."""
    text = page.read_text()
    for shown in _tables(rows):
        rules = ("---" if side == "left" else "---:" for side in shown.columns.values())
        lines = [f"{shown.title}:", "", f"| {' | '.join(shown.columns)} |", f"|{'|'.join(rules)}|"]
        text = _between(text, shown.mark, [*lines, *(f"| {' | '.join(cells)} |" for cells in shown.cells)])
    write_atomically(page, text.encode())


def _tables(rows: Sequence[Row]) -> list[_Table]:
    """Compared with peers, where freed memory is returned and where it is kept; growth; and fits of real data."""
    grown = [row for row in rows if "exponent" in row]
    fitted = [row for row in rows if "ours_accuracy" in row]
    compared = [row for row in rows if "exponent" not in row and "ours_accuracy" not in row]
    # The marks of a page's tables on the CPU bear no name of a device.
    device = "" if rows[0]["device"] == "cpu" else f", {rows[0]['device']}"
    tables = []
    for memory, mark, title in (("returned", "table", ""), ("kept", "kept", ", freed memory kept")):
        if own := [row for row in compared if row["memory"] == memory]:
            cells = [_compared_cells(row) for row in own]
            tables.append(_Table(f"{mark}{device}", f"{own[0]['machine']}{title}", _COMPARED, cells))
    if grown:
        title = f"{grown[0]['machine']}, time = size ^ exponent"
        tables.append(_Table(f"growth{device}", title, _GROWN, [_grown_cells(row) for row in grown]))
    if fitted:
        title = f"{fitted[0]['machine']}, seconds of all folds and mean accuracy"
        tables.append(_Table("fits", title, _FITTED, [_fitted_cells(row) for row in fitted]))
    return tables


_COMPARED: dict[str, Literal["left", "right"]] = {
    "work": "left",
    "size": "left",
    "threads": "right",
    "ours": "right",
    "peer": "left",
    "theirs": "right",
    "ratio": "right",
    "floor": "left",
    "times the floor": "right",
}
_GROWN: dict[str, Literal["left", "right"]] = {
    "work": "left",
    "sizes": "left",
    "time of the largest": "right",
    "exponent": "right",
    "at the top": "right",
}
_FITTED: dict[str, Literal["left", "right"]] = {
    "work": "left",
    "size": "left",
    "threads": "right",
    "ours": "right",
    "accuracy": "right",
    "peer": "left",
    "theirs": "right",
    "their accuracy": "right",
    "ratio": "right",
}


def _compared_cells(row: Row) -> list[str]:
    ours, theirs = time_of(row["ours_s"]), time_of(row["peer_s"])
    named = [row["work"], row["shape"], str(row["threads"]), ours, row["peer"] or "-", theirs, _times(row["ratio"])]
    return [*named, row["floor"] or "-", _times(row["of_floor"])]


def _grown_cells(row: Row) -> list[str]:
    exponents = (f"{row[name]:.2f}" for name in ("exponent", "exponent_at_the_top"))
    return [row["work"], row["shape"], time_of(row["ours_s"]), *exponents]


def _fitted_cells(row: Row) -> list[str]:
    ours = [time_of(row["ours_s"]), f"{row['ours_accuracy']:.3f}"]
    theirs = [time_of(row["peer_s"]), f"{row['peer_accuracy']:.3f}"]
    return [row["work"], row["shape"], str(row["threads"]), *ours, row["peer"], *theirs, _times(row["ratio"])]


def _times(ratio: float | None) -> str:
    """A ratio, with two decimals where it is near 1."""
    if ratio is None:
        return "-"
    return f"{ratio:.2f}" if ratio < 2 else f"{ratio:.1f}"


def _between(text: str, mark: str, lines: Sequence[str]) -> str:
    begin, end = f"<!-- {mark}: begin -->", f"<!-- {mark}: end -->"
    before, rest = text.split(begin)
    return "\n".join([before + begin, *lines, end + rest.split(end)[1]])


def time_of(seconds: float | None) -> str:
    """A time in the unit that suits it."""
    if seconds is None:
        return "-"
    if seconds < 1e-5:
        return f"{seconds * 1e6:.2f} µs"
    if seconds < 1e-3:
        return f"{seconds * 1e6:.0f} µs"
    return f"{seconds * 1e3:.2f} ms" if seconds < 1 else f"{seconds:.2f} s"


def draw(rows: Sequence[Row]) -> bytes:
    """A PNG: how many times faster than each peer, on a logarithmic axis, a dot for each number of threads.

    Hollow where freed memory is kept.
    """
    compared = [row for row in rows if row.get("ratio") is not None]
    names = list(dict.fromkeys((row["work"], row["shape"], row["peer"]) for row in compared))
    figure = Figure(figsize=(10, 1.2 + 0.42 * max(len(names), 1)), layout="constrained")
    axes = figure.subplots()
    threads = sorted({row["threads"] for row in compared})
    for count, colour in zip(threads, ("#4477aa", "#ee6677", "#228833"), strict=False):
        for memory, inside in (("returned", colour), ("kept", "white")):
            own = [row for row in compared if row["threads"] == count and row["memory"] == memory]
            heights = [names.index((row["work"], row["shape"], row["peer"])) for row in own]
            label = f"{count} thread{'s' * (count > 1)}{', freed memory kept' * (memory == 'kept')}"
            if own:
                ratios = [row["ratio"] for row in own]
                axes.plot(ratios, heights, "o", color=colour, markerfacecolor=inside, label=label)
    axes.axvline(1, color="0.4", linewidth=1)
    axes.set_xscale("log")
    axes.set_yticks(range(len(names)), [f"{work}, {shape}\nbeside {peer}" for work, shape, peer in names], fontsize=7)
    axes.invert_yaxis()
    axes.grid(axis="x", which="both", color="0.9")
    axes.set_xlabel("times faster than the peer")
    if compared:
        axes.set_title(rows[0]["machine"], fontsize=9)
        figure.legend(loc="outside upper right", ncols=2)
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=130)
    return content.getvalue()
