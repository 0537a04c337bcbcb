"""How long a robot waits for its commands."""

from __future__ import annotations

import statistics
import time
from typing import Any

import numpy as np

import sim
from experiments.tasks.corral import frozen


def query_seconds(policy: sim.ControllerLike, readings: np.ndarray[Any, Any], calls: int = 200) -> float:
    """Median time of one answer to one robot in the form that drives, over readings of the teacher's runs."""
    rows = readings[np.linspace(0, len(readings) - 1, calls).astype(int)]
    controller = sim.as_controller(frozen(policy))
    state = controller.start(np.zeros(1, dtype=np.int64))
    times = []
    for row in rows:
        start = time.perf_counter()
        _, state = controller.step(row[None], state)
        times.append(time.perf_counter() - start)
    return statistics.median(times)
