"""Read a log of any format."""

from collections.abc import Callable
from pathlib import Path

from behaviours.data.csv_file import read_csv
from behaviours.data.lerobot_folder import is_lerobot, read_lerobot
from behaviours.data.log import Log
from behaviours.data.mcap_file import is_bag, read_mcap
from behaviours.data.minari_set import is_minari, read_minari
from behaviours.data.parquet import read_parquet

READERS: dict[str, Callable[[Path], Log]] = {
    ".csv": read_csv,
    ".tsv": read_csv,
    ".txt": read_csv,
    ".parquet": read_parquet,
    ".mcap": read_mcap,
}
"""The reader of each suffix."""
FOLDERS: dict[str, tuple[Callable[[Path], bool], Callable[[Path], Log]]] = {
    "a LeRobotDataset (with meta/info.json)": (is_lerobot, read_lerobot),
    "a Minari data set (with data/metadata.json)": (is_minari, read_minari),
    "a bag of ROS 2 (with files *.mcap)": (is_bag, read_mcap),
}
"""What a folder may be: whether it is one, and its reader."""


def read(path: str | Path) -> Log:
    """Read a file by its suffix, or a folder by what is in it.

    Raises `ValueError`, with what is allowed, for anything else, and `FileNotFoundError` if there is no such path.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"there is no file {path}")
    if path.is_dir():
        for is_one, reader in FOLDERS.values():
            if is_one(path):
                return reader(path)
        raise ValueError(f"{path}: cannot tell its format; a folder is {', or '.join(FOLDERS)}")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise ValueError(f"{path}: cannot tell its format; a log is one of {', '.join(READERS)}, or a folder")
    return reader(path)
