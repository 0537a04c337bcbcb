"""The "Wall-Following Robot Navigation" set."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

_FOLDER = Path(__file__).parent / "wall_following"


def load_wall_following(sensors: int = 24) -> tuple[Float64[np.ndarray, "5456 n"], np.ndarray[Any, np.dtype[np.str_]]]:
    """The "Wall-Following Robot Navigation" set: 5,456 readings `[5456, sensors]` in metres, and the command of each.

    A SCITOS G5 robot follows a wall; there are 9 rows per second, in time order. The commands are `"Move-Forward"`,
    `"Slight-Right-Turn"`, `"Sharp-Right-Turn"` and `"Slight-Left-Turn"`. Neighbouring rows are similar, so test rows
    should be contiguous stretches of time.

    Args:
        sensors: 24 for the ring of ultrasound sensors, 4 for the shortest distances in front, left, right and behind,
            2 for those in front and left.

    Source: Ananda Freire, Marcus Veloso, Guilherme Barreto (Federal University of Ceará, 2010), UCI Machine
    Learning Repository, DOI 10.24432/C57C8W, licence CC BY 4.0; see `NOTICE.md` in the same folder.
    Raises `ValueError` for another number of sensors.
    """
    if sensors not in (2, 4, 24):
        raise ValueError(f"sensors is 24, 4 or 2; got {sensors!r}")
    text = (_FOLDER / f"sensor_readings_{sensors}.data").read_text(encoding="ascii")
    rows = [line.split(",") for line in text.split()]
    return np.array([row[:-1] for row in rows], dtype=np.float64), np.array([row[-1] for row in rows])
