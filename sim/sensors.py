"""The robot's sensors: a pair for each colour of light, one for distance.

The light sensors are on the robot's rim at ±`LIGHT_MOUNT` from the heading. Their cones overlap, so that both are lit
when the robot faces the lamp. They see the lamp's axis, not its rim; an obstacle in between hides it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.robot import RADIUS
from sim.shapes import Lamp, Shapes

Floats = NDArray[np.float64]
LIGHT_MAX = 5.0
"""The reading of a light sensor that senses no lamp, m."""
LIGHT_REACH = 4.5
"""Light is sensed up to this distance, m. Every lit reading is at least 1/10 of the range below `LIGHT_MAX`."""
LIGHT_MOUNT = math.radians(60)
"""Bearing of the light sensors on the rim; left is positive."""
LIGHT_INWARD, LIGHT_OUTWARD = math.radians(40), math.radians(60)
"""Each cone extends this far across the heading, and this far to its own side."""

DISTANCE_MAX = 0.6
"""Range of the distance sensor, and its reading if nothing is hit, m."""
BEAMS = (0.0, 0.4, -0.4)
"""Bearings of the distance sensor's beams; the nearest hit counts. A single beam misses walls at a grazing angle."""

_MOUNTS = [(RADIUS * math.cos(bearing), RADIUS * math.sin(bearing)) for bearing in (LIGHT_MOUNT, -LIGHT_MOUNT)]
# For each side, the unit vectors along the right and the left edge of its cone.
_CONES = [
    [(math.cos(bearing), math.sin(bearing)) for bearing in edges]
    for edges in ((-LIGHT_INWARD, LIGHT_OUTWARD), (-LIGHT_OUTWARD, LIGHT_INWARD))
]
_DIRECTIONS = [(math.cos(bearing), math.sin(bearing)) for bearing in BEAMS]


def read(
    pairs: Sequence[Sequence[Lamp]], obstacles: Shapes, x: Floats, y: Floats, cos: Floats, sin: Floats, clear: Floats
) -> Floats:
    """Readings `[B, 2 * pairs + 1]` of robots at `x`, `y` `[B]` with the heading (`cos`, `sin`), without noise.

    For each pair of light sensors and the lamps that it senses, left and right: the distance from the sensor to the
    lamp's surface (at least 0) if the lamp's axis is inside the cone, nearer than `LIGHT_REACH` and not behind an
    obstacle, else `LIGHT_MAX`; of several lamps the nearest. Then the length of the beam from the rim to the nearest
    obstacle ahead, `DISTANCE_MAX` if nothing is hit. `clear` `[B]` is the distance from the robot's centre to
    the nearest obstacle.

    The batch is computed with sums, products and square roots only, so no row's bits depend on other rows.
    """
    readings = np.full((2 * len(pairs) + 1, len(x)), LIGHT_MAX)
    for pair, lamps in enumerate(pairs):
        for lamp in lamps:
            dx, dy = lamp.x - x, lamp.y - y
            ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
            for side in (0, 1):
                reading, rows = _light(lamp, side, ahead, aside)
                forward, left = _MOUNTS[side]
                sensor_x = x[rows] + forward * cos[rows] - left * sin[rows]
                sensor_y = y[rows] + forward * sin[rows] + left * cos[rows]
                ends = np.full(rows.size, lamp.x), np.full(rows.size, lamp.y)
                seen = obstacles.first_hit(sensor_x, sensor_y, *ends) >= 1.0
                column = readings[2 * pair + side]
                column[rows] = np.minimum(column[rows], np.where(seen, reading[rows], LIGHT_MAX))
    readings[-1] = _distance(obstacles, x, y, cos, sin, clear)
    return readings.T.copy()


def _light(lamp: Lamp, side: int, ahead: Floats, aside: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """The distance from a sensor to a lamp that is `ahead` of and `aside` from the robot, and the rows with the lamp's
    axis inside the cone and within reach."""
    (forward, left), ((right_x, right_y), (left_x, left_y)) = _MOUNTS[side], _CONES[side]
    ahead, aside = ahead - forward, aside - left
    reading = np.maximum(np.sqrt(ahead * ahead + aside * aside) - lamp.radius, 0.0)
    inside = (right_x * aside >= right_y * ahead) & (left_x * aside <= left_y * ahead) & (reading < LIGHT_REACH)
    return reading, np.flatnonzero(inside)


def _distance(obstacles: Shapes, x: Floats, y: Floats, cos: Floats, sin: Floats, clear: Floats) -> Floats:
    reading = np.full(len(x), DISTANCE_MAX)
    near = np.flatnonzero(clear < RADIUS + DISTANCE_MAX + 1e-6)  # the beams of the others reach no obstacle
    x, y, cos, sin = x[near], y[near], cos[near], sin[near]
    ways = [(cos * c - sin * s, sin * c + cos * s) for c, s in _DIRECTIONS]
    way_x, way_y = (np.concatenate(parts) for parts in zip(*ways, strict=True))
    x, y, far = np.tile(x, len(BEAMS)), np.tile(y, len(BEAMS)), RADIUS + DISTANCE_MAX
    hits = obstacles.first_hit(x + RADIUS * way_x, y + RADIUS * way_y, x + far * way_x, y + far * way_y)
    reading[near] = DISTANCE_MAX * hits.reshape(len(BEAMS), -1).min(0)
    return reading
