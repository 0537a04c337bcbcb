"""Read a file of any format."""

from collections.abc import Callable
from pathlib import Path

from behaviours.data.csv_file import read_csv
from behaviours.data.log import Log
from behaviours.data.parquet import read_parquet

READERS: dict[str, Callable[[Path], Log]] = {
    ".csv": read_csv,
    ".tsv": read_csv,
    ".txt": read_csv,
    ".parquet": read_parquet,
}
"""The reader of each suffix."""


def read(path: str | Path) -> Log:
    """Read a file by its suffix. Raises `ValueError` for other suffixes, `FileNotFoundError` if there is no file."""
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"there is no file {path}")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise ValueError(f"{path}: cannot tell its format; a log is one of {', '.join(READERS)}")
    return reader(path)
