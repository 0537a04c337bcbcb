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


def fitting(widths: Sequence[int], most: float, keys: int) -> list[list[int]]:
    """The places of columns in parts: the first `keys`, and as many others as fit into a line, at least one."""
    first = list(range(keys))
    parts = [first]
    for place in range(keys, len(widths)):
        if parts[-1] != first and line_width([widths[each] for each in (*parts[-1], place)]) > most:
            parts.append(first)
        parts[-1] = [*parts[-1], place]
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
