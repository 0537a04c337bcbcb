"""The table of a benchmark on the terminal, and as a figure."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from behaviours.storage import write_atomically

Row = dict[str, Any]


def wide_console() -> Console:
    """The terminal, or a file as wide as the tables: it has no width of its own."""
    console = Console()
    if not console.is_terminal:
        console.width = 160
    return console


def print_rows(rows: Sequence[Row], console: Console) -> None:
    """Ratios to the peers, then exponents of growth."""
    for title, compared in _compared(rows).items():
        table = Table(title=title)
        for name in ("work", "shape", "threads", "ours", "peer", "theirs", "ratio", "floor", "of floor"):
            table.add_column(name, justify="left" if name in ("work", "shape", "peer", "floor") else "right")
        for row in compared:
            table.add_row(*_cells(row))
        console.print(table)
    grown = [row for row in rows if "exponent" in row]
    if grown:
        table = Table(title="time = size ^ exponent")
        for title in ("work", "sizes", "longest", "exponent", "at the top"):
            table.add_column(title, justify="right")
        for row in grown:
            exponents = (f"{row['exponent']:.2f}", f"{row['exponent_at_the_top']:.2f}")
            table.add_row(row["work"], row["shape"], time_of(row["ours_s"]), *exponents)
        console.print(table)


def _compared(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """The rows of each table beside peers, by its title."""
    tables: dict[str, list[Row]] = {}
    for row in rows:
        if "exponent" not in row:
            title = row["machine"] + (", freed memory kept" if row["memory"] == "kept" else "")
            tables.setdefault(title, []).append(row)
    return tables


def fill(page: Path, rows: Sequence[Row]) -> None:
    """Write the tables of a page anew, between their marks."""
    grown = [row for row in rows if "exponent" in row]
    text = page.read_text()
    for title, compared in _compared(rows).items():
        lines = ["| work | size | threads | ours | peer | theirs | ratio | floor | times the floor |"]
        lines.append("|---|---|---:|---:|---|---:|---:|---|---:|")
        for row in compared:
            lines.append(f"| {' | '.join(_cells(row))} |")
        mark = "kept" if compared[0]["memory"] == "kept" else "table"
        text = _between(text, mark, [f"{title}:", "", *lines])
    if grown:
        lines = ["| work | sizes | time of the largest | exponent | at the top |", "|---|---|---:|---:|---:|"]
        for row in grown:
            exponents = f"{row['exponent']:.2f} | {row['exponent_at_the_top']:.2f}"
            lines.append(f"| {row['work']} | {row['shape']} | {time_of(row['ours_s'])} | {exponents} |")
        text = _between(text, "growth", lines)
    write_atomically(page, text.encode())


def _cells(row: Row) -> list[str]:
    """A row beside a peer, as text."""
    ours, theirs = time_of(row["ours_s"]), time_of(row["peer_s"])
    named = [row["work"], row["shape"], str(row["threads"]), ours, row["peer"] or "-", theirs, _times(row["ratio"])]
    return [*named, row["floor"] or "-", _times(row["of_floor"])]


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
        axes.legend()
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=130)
    return content.getvalue()
