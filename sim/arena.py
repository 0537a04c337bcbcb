"""An arena is data: walls and boxes, pillars, lamps, and where robots start.

Lengths are in metres, angles in radians (0 along +x, counter-clockwise). Everything is seen from above.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sim.checks import whole_number
from sim.robot import RADIUS, TOUCH
from sim.shapes import Box, Lamp, Obstacle, Shapes, finite

Floats = NDArray[np.float64]

WALL_THICKNESS = 0.06
"""Thickness of the walls of `walls`, m."""
SMALLEST_MARGIN = 0.2
"""Smallest distance from a start to an obstacle, m: the robot's radius and some clearance."""
_TRIES = 1000


@dataclass(frozen=True)
class Arena:
    """Where robots drive. Raises `ValueError` that names the field for geometry that cannot be.

    Attributes:
        obstacles: boxes (walls are boxes) and pillars, all higher than the robot's beams.
        lamps: at least one.
        floor: the inside of the corral; robots start here.
        outline: the corral with its walls; a robot whose centre is outside has escaped.
        start_margin: smallest distance from a start to the floor's edge and to obstacles, m.
        wheel_noise: standard deviation of a wheel's speed, as a fraction of the commanded speed. Without noise robots
            can bounce between walls in a cycle forever.
    """

    obstacles: tuple[Obstacle, ...]
    lamps: tuple[Lamp, ...]
    floor: Box
    outline: Box
    start_margin: float = 0.3
    wheel_noise: float = 0.3

    def __post_init__(self) -> None:
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        object.__setattr__(self, "lamps", tuple(self.lamps))
        finite(self, ("start_margin", "wheel_noise"))
        if not self.lamps:
            raise ValueError("Arena.lamps is empty; expected at least one")
        for lamp in self.lamps:
            near = float(Shapes(self.obstacles).distance(np.array([lamp.x]), np.array([lamp.y]))[0])
            if near < lamp.radius:
                raise ValueError(f"Arena.lamps holds {lamp}, {near:g} m from an obstacle; expected its radius or more")
        half = min(self.floor.half_x, self.floor.half_y)
        if not SMALLEST_MARGIN <= self.start_margin < half:
            raise ValueError(
                f"Arena.start_margin is {self.start_margin} m; expected at least {SMALLEST_MARGIN} m (the robot's "
                f"radius plus clearance) and less than half the floor, {half:g} m"
            )
        if self.wheel_noise < 0:
            raise ValueError(f"Arena.wheel_noise is {self.wheel_noise}; expected a fraction of the speed, 0 or more")

    @property
    def solids(self) -> Shapes:
        """All that a robot can touch: obstacles and lamps."""
        return Shapes([*self.obstacles, *self.lamps])

    def touched(self, x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Whether robots at these positions touch an obstacle or a lamp, `[B]`."""
        return self.solids.distance(x, y) - RADIUS <= TOUCH

    def extent(self) -> tuple[float, float, float, float]:
        """The smallest and the largest x, the smallest and the largest y of all that there is, m."""
        shapes = (self.outline, *self.obstacles, *self.lamps)
        x, y = np.array([(shape.x, shape.y) for shape in shapes]).T
        half_x, half_y = np.array(
            [(shape.half_x, shape.half_y) if isinstance(shape, Box) else [shape.radius] * 2 for shape in shapes]
        ).T
        ends = (x - half_x).min(), (x + half_x).max(), (y - half_y).min(), (y + half_y).max()
        low_x, high_x, low_y, high_y = map(float, ends)
        return low_x, high_x, low_y, high_y


@dataclass(frozen=True)
class Start:
    """The start pose of an episode: x, y in m, heading in rad."""

    x: float
    y: float
    heading: float


def walls(floor: Box, gaps: Iterable[tuple[float, float]] = (), thickness: float = WALL_THICKNESS) -> list[Box]:
    """Walls around a floor, with `gaps` in the wall at its largest x: the middle y and the width of each, in m.

    Raises `ValueError` unless a piece of wall is left at both ends and between the gaps, and robots fit through them.
    """
    thick, right, top = thickness / 2, floor.x + floor.half_x, floor.y + floor.half_y
    outer_x, outer_y = floor.half_x + thickness, floor.half_y + thickness
    around = [
        Box(floor.x - floor.half_x - thick, floor.y, thick, outer_y),
        Box(floor.x, top + thick, outer_x, thick),
        Box(floor.x, floor.y - floor.half_y - thick, outer_x, thick),
    ]
    ends = [floor.y - floor.half_y]
    for middle, width in sorted(gaps):
        if not width > 2 * RADIUS:
            raise ValueError(f"gap is {width} m wide; it must be wider than the robot, {2 * RADIUS} m")
        ends += [middle - width / 2, middle + width / 2]
    ends.append(top)
    if any(low >= high for low, high in pairwise(ends)):
        raise ValueError(
            f"gap {[f'{width} m at {middle} m' for middle, width in gaps]}: it must leave a piece of wall at both ends "
            f"of the {2 * floor.half_y} m side, and between two gaps"
        )
    pieces = zip(ends[::2], ends[1::2], strict=True)
    return around + [Box(right + thick, (low + high) / 2, thick, (high - low) / 2) for low, high in pieces]


def square(side: float, gaps: Iterable[tuple[float, float]]) -> tuple[list[Box], Box, Box]:
    """Walls, floor and outline of a square corral, centred on the origin, with `gaps` as in `walls`."""
    half = side / 2
    floor, outline = Box(0.0, 0.0, half, half), Box(0.0, 0.0, half + WALL_THICKNESS, half + WALL_THICKNESS)
    return walls(floor, gaps), floor, outline


def draw_episodes(arena: Arena, seed: int, episodes: Iterable[int]) -> tuple[Floats, list[np.random.Generator]]:
    """Draw the starts `[B, 3]` (x, y, heading) of episodes, and the generators that draw their wheel noise.

    A generator is seeded with (seed, episode), so every controller gets the same start and the same noise at any batch
    size, worker count or order. Positions are uniform over the floor without its margin and without the surroundings
    of obstacles and lamps, headings over the circle. Raises `ValueError` unless seed and episodes are whole numbers, 0
    or more, and if no free place is found.
    """
    seed = whole_number("seed", seed)
    generators = [np.random.default_rng([seed, whole_number("episode", episode)]) for episode in episodes]
    floor, margin, solids = arena.floor, arena.start_margin, arena.solids
    middle = np.array([floor.x, floor.y, 0.0])
    reach = np.array([floor.half_x - margin, floor.half_y - margin, math.pi])
    starts, open_rows = np.empty((len(generators), 3)), np.arange(len(generators))
    for _ in range(_TRIES):
        draws = np.array([generators[row].uniform(-1.0, 1.0, size=3) for row in open_rows.tolist()]).reshape(-1, 3)
        starts[open_rows] = middle + draws * reach
        free = solids.distance(*starts[open_rows, :2].T) >= margin - 1e-9  # the margin itself, rounded, is free
        open_rows = open_rows[~free]
        if not open_rows.size:
            return starts, generators
    raise ValueError(f"no place to start in {_TRIES} tries: the obstacles leave too little of the floor")


def draw_start(arena: Arena, seed: int, episode: int) -> Start:
    """The start of an episode, as `draw_episodes` draws it."""
    return Start(*draw_episodes(arena, seed, [episode])[0][0].tolist())
