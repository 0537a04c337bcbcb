"""All robots of a batch stepped in one pass of array operations, without a physics library."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim.arena import Arena, Start
from sim.engine import Engine, Floats, Integers, Poses
from sim.robot import CONTROL_HZ, RADIUS, SUBSTEPS, TRACK
from sim.shapes import Shapes
from sim.task import Task

PUSHES = 8
"""How often a robot is pushed out of what it has entered most, at most: in a corner each push leads into the other
wall, by less each time."""


class Vector(Engine):
    """Round robots with a differential drive that slide along what they touch.

    A robot that would enter an obstacle or a lamp is pushed out along the shortest way. Sums, products, divisions and
    square roots are all that touches a row, so its bits depend on no neighbour and on no place in the batch; sines and
    cosines come from series.
    """

    bodies = ("planar",)
    robots = 4096

    def __init__(self, size: int, arena: Arena, task: Task, body: str | None = None, seed: int = 0) -> None:
        super().__init__(size, arena, task, body, seed)
        self._x, self._y, self._heading = np.zeros((3, size))
        self._cos, self._sin, self._clear = np.ones(size), np.zeros(size), np.zeros(size)
        self._solids = arena.solids
        self._lamps = Shapes(arena.lamps)

    def _place(self, slots: Integers, starts: Floats) -> None:
        self._x[slots], self._y[slots], self._heading[slots] = starts.T
        self._cos[slots] = [math.cos(heading) for heading in starts[:, 2].tolist()]
        self._sin[slots] = [math.sin(heading) for heading in starts[:, 2].tolist()]
        self._clear[slots] = self.obstacles.distance(*starts[:, :2].T)

    def _poses(self, slots: Integers) -> Poses:
        columns = self._x, self._y, self._heading, self._cos, self._sin, self._clear
        return Poses(*(column[slots] for column in columns))

    def picture(self, slot: int) -> NDArray[np.uint8]:
        """See `Engine.picture`."""
        from sim.engines.camera import render_rgb
        from sim.engines.world import World

        with World(self.arena, "planar") as world:
            world.body.place(Start(float(self._x[slot]), float(self._y[slot]), float(self._heading[slot])))
            return render_rgb(world.client, self.arena)

    def _move(self, slots: Integers, speeds: Floats) -> None:
        left, right = speeds.T
        step = (left + right) * (0.5 / (CONTROL_HZ * SUBSTEPS))
        turn = (right - left) * (1.0 / (TRACK * CONTROL_HZ * SUBSTEPS))
        x, y, cos, sin = self._x[slots], self._y[slots], self._cos[slots], self._sin[slots]
        clear = np.minimum(self._clear[slots], self._lamps.distance(x, y))
        near = np.flatnonzero(clear <= RADIUS + SUBSTEPS * np.abs(step) + 1e-6)  # the others touch nothing
        half_cos, half_sin = rotation(turn * 0.5)
        for _ in range(SUBSTEPS):
            # Straight along the middle heading of the arc.
            cos, sin = cos * half_cos - sin * half_sin, sin * half_cos + cos * half_sin
            x, y = x + step * cos, y + step * sin
            if near.size:
                x[near], y[near] = self._pushed_out(x[near], y[near])
            cos, sin = cos * half_cos - sin * half_sin, sin * half_cos + cos * half_sin
        length = np.sqrt(cos * cos + sin * sin)
        heading = self._heading[slots] + SUBSTEPS * turn
        heading -= (2 * math.pi) * np.ceil((heading - math.pi) / (2 * math.pi))
        self._x[slots], self._y[slots], self._heading[slots] = x, y, heading
        self._cos[slots], self._sin[slots] = cos / length, sin / length
        self._clear[slots] = self.obstacles.distance(x, y)

    def _pushed_out(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        rows = np.arange(len(x))
        for _ in range(PUSHES):
            dx, dy, away = self._solids.offsets(x[rows], y[rows])
            entered = np.flatnonzero(away.min(axis=0) < RADIUS - 1e-12)  # but for rounding
            if not entered.size:
                break
            rows, deepest = rows[entered], away[:, entered].argmin(axis=0)
            dx, dy, away = (part[deepest, entered] for part in (dx, dy, away))
            # A robot's centre is never in a box: a step is shorter than its radius.
            scale = (RADIUS - away) / np.maximum(np.sqrt(dx * dx + dy * dy), 1e-12)
            x[rows], y[rows] = x[rows] + dx * scale, y[rows] + dy * scale
        return x, y


def rotation(angle: Floats) -> tuple[Floats, Floats]:
    """Cosine and sine of small angles (below .6 rad to the last digit), from their series."""
    square = angle * angle
    cos, sin = np.ones_like(angle), np.ones_like(angle)
    for power in range(16, 0, -2):
        cos = 1.0 - square * cos * (1.0 / (power * (power - 1)))
        sin = 1.0 - square * sin * (1.0 / (power * (power + 1)))
    return cos, angle * sin
