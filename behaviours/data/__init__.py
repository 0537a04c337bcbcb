"""Recorded data in and out: CSV, Parquet, other robots' formats, and real data that are part of the package.

Each reader imports its library when it is called; `pip install 'torchvsa[data]'` has all of them.
"""

from behaviours.data.csv_file import read_csv
from behaviours.data.gymnasium_env import action_of, collect, readings_of, schema_from_env
from behaviours.data.lerobot_folder import read_lerobot
from behaviours.data.log import Log
from behaviours.data.mcap_file import read_mcap
from behaviours.data.minari_set import read_minari, write_minari
from behaviours.data.parquet import read_parquet
from behaviours.data.reading import read
from behaviours.data.wall_following_set import load_wall_following

__all__ = [
    "Log",
    "action_of",
    "collect",
    "load_wall_following",
    "read",
    "read_csv",
    "read_lerobot",
    "read_mcap",
    "read_minari",
    "read_parquet",
    "readings_of",
    "schema_from_env",
    "write_minari",
]
