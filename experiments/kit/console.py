"""The terminal that studies and benchmarks print to."""

from rich.console import Console


def wide_console(width: int = 150) -> Console:
    """The terminal; or a file, which has no width of its own, as wide as the tables need."""
    console = Console()
    if not console.is_terminal:
        console.width = width
    return console
