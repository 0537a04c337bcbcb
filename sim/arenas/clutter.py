"""The corral with boxes and pillars inside."""

import math

import numpy as np

from sim.arena import Arena
from sim.arenas.corral import corral
from sim.arenas.registry import ARENAS
from sim.shapes import Box, Pillar

SMALLEST, LARGEST = 0.08, 0.14
"""Half the width of a box, or the radius of a pillar, m."""
PASSAGE = 0.45
"""Robots, .3 m wide, fit between any two obstacles, m."""
BEFORE_THE_GAP = 0.75
"""No obstacle's middle is nearer to the gap's, m."""


def clutter(layout: int = 0, wheel_noise: float = 0.3) -> Arena:
    """The default corral with 4 to 6 obstacles, boxes and pillars in turns, drawn from the number of the `layout`."""
    generator, side = np.random.default_rng([77, layout]), 3.0
    number, placed = int(generator.integers(4, 7)), []
    while len(placed) < number:
        x, y = generator.uniform(-1.0, 1.0, 2).tolist()
        half = float(generator.uniform(SMALLEST, LARGEST))
        apart = all(max(abs(x - a), abs(y - b)) - half - other >= PASSAGE for a, b, other in placed)
        if apart and math.hypot(x - side / 2, y) >= BEFORE_THE_GAP:
            placed.append((x, y, half))
    within = tuple(
        Pillar(x, y, half) if index % 2 else Box(x, y, half, half) for index, (x, y, half) in enumerate(placed)
    )
    return corral(side=side, wheel_noise=wheel_noise, within=within)


ARENAS["clutter"] = clutter
