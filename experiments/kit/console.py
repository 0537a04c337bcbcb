"""The terminal that studies and benchmarks print to, and how tables fit into it."""

from collections.abc import Sequence

from rich.console import Console


def wide_console(width: int = 150) -> Console:
    """The terminal; or a file, which has no width of its own, with this one."""
    console = Console()
    if not console.is_terminal:
        console.width = width
    return console


def line_width(widths: Sequence[int]) -> int:
    """The characters of a line: each cell has a space on both sides, and a border."""
    return 1 + sum(width + 3 for width in widths)


def fitting(widths: Sequence[int], most: float) -> list[list[int]]:
    """The places of columns in parts: the first column, and as many others as fit into a line, at least one."""
    parts = [[0]]
    for place in range(1, len(widths)):
        if len(parts[-1]) > 1 and line_width([widths[each] for each in (*parts[-1], place)]) > most:
            parts.append([0])
        parts[-1].append(place)
    return parts


def widened(widths: Sequence[int], wanted: Sequence[int], most: int) -> list[int]:
    """The widths of columns, the narrowest ones widened to what is `wanted` while their line has at most so many."""
    found = list(widths)
    while line_width(found) < most:
        short = [place for place, width in enumerate(found) if width < wanted[place]]
        if not short:
            break
        found[min(short, key=found.__getitem__)] += 1
    return found
