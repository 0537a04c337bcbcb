"""The robot's sensors: two for light, one for distance.

The light sensors are on the robot's rim at ±`LIGHT_MOUNT` from the heading. Their cones overlap, so that both are lit
when the robot faces the lamp. They see the lamp's axis, not its rim; a wall in between hides it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim._pybullet import pybullet
from sim.channel import Channel
from sim.corral import WALL_GROUP, Arena
from sim.robot import RADIUS

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
SENSOR_HEIGHT = 0.16
"""Height of all beams, m: above the lamp, below the top of the walls."""

SENSORS = (
    Channel("light_left", 0.0, LIGHT_MAX, "m"),
    Channel("light_right", 0.0, LIGHT_MAX, "m"),
    Channel("distance", 0.0, DISTANCE_MAX, "m"),
)
"""The readings, in order."""


class SensorArray:
    """Reads the sensors of a batch of robots in one arena, each in its own pybullet client.

    `light_left`, `light_right`: distance from the sensor to the lamp's surface (at least 0) if the lamp's axis is
    inside the cone, nearer than `LIGHT_REACH` and not behind a wall, else `LIGHT_MAX`. `distance`: length of the
    beam from the rim to the nearest wall ahead, `DISTANCE_MAX` if nothing is hit. Readings are without noise.
    """

    def __init__(self, arena: Arena) -> None:
        self._lamp = arena.lamp
        self._lamp_radius = arena.lamp_radius
        across, out = LIGHT_INWARD, LIGHT_OUTWARD
        # Per sensor: mount, and the unit vectors along the right and the left edge of its cone.
        self._mount = [(RADIUS * math.cos(a), RADIUS * math.sin(a)) for a in (LIGHT_MOUNT, -LIGHT_MOUNT)]
        edges = [(-across, out), (-out, across)]
        self._edges = [[(math.cos(a), math.sin(a)) for a in pair] for pair in edges]
        self._beams = [(math.cos(a), math.sin(a)) for a in BEAMS]

    def read(
        self,
        clients: Sequence[int],
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        cos: NDArray[np.float64],
        sin: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Readings `[B, 3]` (see `SENSORS`) of robots at `x`, `y` `[B]` with heading (`cos`, `sin`).

        The batch is computed with sums, products and square roots only, so no row's bits depend on other rows.
        """
        readings = np.empty((len(clients), 3))
        candidates: list[list[bool]] = []
        origins: list[list[list[float]]] = []
        for i, ((forward, left), (right_edge, left_edge)) in enumerate(zip(self._mount, self._edges, strict=True)):
            sensor_x = x + forward * cos - left * sin
            sensor_y = y + forward * sin + left * cos
            dx, dy = self._lamp[0] - sensor_x, self._lamp[1] - sensor_y
            ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
            reading = np.maximum(np.sqrt(dx * dx + dy * dy) - self._lamp_radius, 0.0)
            seen = (
                (right_edge[0] * aside - right_edge[1] * ahead >= 0)
                & (left_edge[0] * aside - left_edge[1] * ahead <= 0)
                & (reading < LIGHT_REACH)
            )
            readings[:, i] = np.where(seen, reading, LIGHT_MAX)
            candidates.append(seen.tolist())
            origins.append(np.stack([sensor_x, sensor_y], axis=1).tolist())
        beams = [
            (
                np.stack([x + RADIUS * ux, y + RADIUS * uy], axis=1).tolist(),
                np.stack([x + (RADIUS + DISTANCE_MAX) * ux, y + (RADIUS + DISTANCE_MAX) * uy], axis=1).tolist(),
            )
            for ux, uy in ((cos * c - sin * s, sin * c + cos * s) for c, s in self._beams)
        ]
        target = [*self._lamp, SENSOR_HEIGHT]
        for row, client in enumerate(clients):
            starts = [[*begin[row], SENSOR_HEIGHT] for begin, _ in beams]
            ends = [[*end[row], SENSOR_HEIGHT] for _, end in beams]
            lights = [i for i in (0, 1) if candidates[i][row]]
            for i in lights:
                starts.append([*origins[i][row], SENSOR_HEIGHT])
                ends.append(target)
            hits = pybullet.rayTestBatch(
                starts, ends, numThreads=1, collisionFilterMask=WALL_GROUP, physicsClientId=client
            )
            readings[row, 2] = DISTANCE_MAX * min(hit[2] for hit in hits[: len(beams)])
            for i, hit in zip(lights, hits[len(beams) :], strict=True):
                if hit[0] >= 0:
                    readings[row, i] = LIGHT_MAX
        return readings
