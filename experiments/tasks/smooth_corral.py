"""The corral's rules without their steps, as a teacher of smooth commands."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.sensors import LIGHT_MAX

NEAR = 0.5
"""The teacher turns away from walls below this distance, m; it solves the default arena with any from 0.35 to 0.6."""


def corral_commands(sensors: NDArray[np.float64], *_: Any) -> NDArray[np.float64]:
    """Commands `[B, 2]` in [-1, 1] for readings `[B, 3]`; a controller.

    The nearer the wall and the darker, the slower and the more to the left; the brighter one side, the more towards it.
    """
    left, right = 1 - sensors[:, 0] / LIGHT_MAX, 1 - sensors[:, 1] / LIGHT_MAX
    away = 2 * np.clip(1 - sensors[:, 2] / NEAR, 0, 1) * (1 - np.maximum(left, right))
    turn = 2 * (right - left) - away
    return np.clip(np.stack([1 - away + turn, 1 - away - turn], axis=1), -1, 1)
