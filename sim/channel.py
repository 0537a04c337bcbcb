"""One sensor or motor of the robot."""

from typing import NamedTuple


class Channel(NamedTuple):
    """A sensor or motor: its name, the range of its values, and their unit."""

    name: str
    low: float
    high: float
    unit: str
