"""The world: a square corral with one gap, and a lamp outside it.

The corral is centred on the origin; its inner faces are at x, y = ±side/2. The gap is in the wall at x = +side/2, and
the lamp is beyond it. Lengths are in metres, angles in radians (0 along +x, counter-clockwise).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sim._pybullet import pybullet
from sim.checks import whole_number

WALL_GROUP, WALL_MASK = 1, 3
"""Walls, lamp and floor collide with everything. With other values `rayTestBatch` with a mask misses them."""
ROBOT_GROUP, ROBOT_MASK = 2, 1
"""Robots collide with the world; rays with the mask `WALL_GROUP` ignore them."""

_CLEARANCE = 0.2  # smallest start margin, m: no robot may start inside a wall


@dataclass(frozen=True)
class Arena:
    """Geometry and noise of one corral. Raises `ValueError` that names the field for impossible geometry.

    Attributes:
        side: inner edge length of the corral, m.
        gap: width of the opening in the wall at x = +side/2, m.
        gap_offset: y of the opening's middle, m.
        lamp_beyond: distance from that wall's inner face to the lamp's axis, m.
        lamp_offset: y of the lamp's axis relative to the opening's middle, m.
        lamp_radius: m.
        lamp_height: m; below the sensors, so that the lamp stops the robot but not their beams.
        wall_height: m; above the sensors.
        wall_thickness: m.
        start_margin: smallest distance from a start position to an inner face, m.
        wheel_noise: standard deviation of a wheel's speed, as a fraction of the commanded speed. Without noise robots
            can bounce between walls in a cycle forever.
    """

    side: float = 3.0
    gap: float = 1.0
    gap_offset: float = 0.0
    lamp_beyond: float = 0.8
    lamp_offset: float = 0.0
    lamp_radius: float = 0.15
    lamp_height: float = 0.1
    wall_height: float = 0.25
    wall_thickness: float = 0.06
    start_margin: float = 0.3
    wheel_noise: float = 0.3

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise ValueError(f"Arena.{field.name} is {value!r}; expected a finite number")
        for name in ("side", "gap", "lamp_beyond", "lamp_radius", "lamp_height", "wall_height", "wall_thickness"):
            if getattr(self, name) <= 0:
                raise ValueError(f"Arena.{name} is {getattr(self, name)}; expected a length above 0 m")
        if abs(self.gap_offset) + self.gap / 2 >= self.side / 2:
            raise ValueError(
                f"Arena.gap is {self.gap} m wide at offset {self.gap_offset} m; "
                f"it must leave a piece of wall at both ends of the {self.side} m side"
            )
        if self.lamp_beyond < self.wall_thickness + self.lamp_radius:
            raise ValueError(
                f"Arena.lamp_beyond is {self.lamp_beyond} m; a lamp of radius {self.lamp_radius} m must be at least "
                f"{self.wall_thickness + self.lamp_radius} m away to clear the wall"
            )
        if not _CLEARANCE <= self.start_margin < self.side / 2:
            raise ValueError(
                f"Arena.start_margin is {self.start_margin} m; expected at least {_CLEARANCE} m (the robot's radius "
                f"plus clearance) and less than half the side, {self.side / 2} m"
            )
        if self.wheel_noise < 0:
            raise ValueError(f"Arena.wheel_noise is {self.wheel_noise}; expected a fraction of the speed, 0 or more")

    @property
    def lamp(self) -> tuple[float, float]:
        """Position (x, y) of the lamp's axis, m."""
        return self.side / 2 + self.lamp_beyond, self.gap_offset + self.lamp_offset

    @property
    def walls(self) -> NDArray[np.float64]:
        """Wall boxes seen from above `[5, 4]`: centre x, centre y, half extent x, half extent y, in m."""
        half, thick = self.side / 2, self.wall_thickness / 2
        low, high = self.gap_offset - self.gap / 2, self.gap_offset + self.gap / 2
        outer = half + 2 * thick
        return np.array(
            [
                [-half - thick, 0.0, thick, outer],
                [0.0, half + thick, outer, thick],
                [0.0, -half - thick, outer, thick],
                [half + thick, (high + half) / 2, thick, (half - high) / 2],
                [half + thick, (low - half) / 2, thick, (low + half) / 2],
            ]
        )


ARENAS: dict[str, Arena] = {
    "default": Arena(),
    "narrow": Arena(gap=0.7),
    "offset_lamp": Arena(lamp_offset=1.0),
    "large": Arena(side=4.8),
}
"""Arenas by name. The teacher solves the default; each of the others is harder in one respect.

Success of the teacher over 200 starts, planar and wheeled: `narrow` 1.00 and .84 (wheels catch on the edge of the gap),
`offset_lamp` .98 and .96 (some robots leave and miss the lamp), `large` .99 and .99 (takes 1.5 times as long).
"""


def find_arena(arena: str | Arena) -> Arena:
    """Find an arena by name; an `Arena` is returned as it is. Raises `ValueError` that lists the known names."""
    if isinstance(arena, Arena):
        return arena
    if not isinstance(arena, str) or arena not in ARENAS:
        raise ValueError(f"unknown arena {arena!r}; expected an Arena or one of {sorted(ARENAS)}")
    return ARENAS[arena]


@dataclass(frozen=True)
class Start:
    """The start pose of an episode: x, y in m, heading in rad (0 faces the wall with the gap)."""

    x: float
    y: float
    heading: float


def draw_episode(arena: Arena, seed: int, episode: int) -> tuple[Start, np.random.Generator]:
    """Draw the start of an episode, and return it with the generator that draws the episode's wheel noise.

    The generator is seeded with (seed, episode), so every controller gets the same start and the same noise at any
    batch size, worker count or order. Positions are uniform over the corral without its margin, headings over the
    circle. Raises `ValueError` unless seed and episode are whole numbers, 0 or more.
    """
    seed, episode = whole_number("seed", seed), whole_number("episode", episode)
    generator = np.random.default_rng([seed, episode])
    reach = arena.side / 2 - arena.start_margin
    x, y, turn = generator.uniform(-1.0, 1.0, size=3).tolist()
    return Start(x * reach, y * reach, turn * math.pi), generator


def draw_start(arena: Arena, seed: int, episode: int) -> Start:
    """The start of an episode, as `draw_episode` draws it."""
    return draw_episode(arena, seed, episode)[0]


def build_corral(arena: Arena, client: int) -> None:
    """Add the walls and the lamp of `arena` to the pybullet `client`, as fixed bodies without friction.

    The floor is only visual: a body that stands on the ground adds its own.
    """
    floor = pybullet.createVisualShape(
        pybullet.GEOM_BOX,
        halfExtents=[2 * arena.side, 2 * arena.side, 0.01],
        rgbaColor=[0.90, 0.90, 0.87, 1],
        specularColor=[0, 0, 0],
        physicsClientId=client,
    )
    pybullet.createMultiBody(0, -1, floor, [0, 0, -0.01], physicsClientId=client)
    for x, y, half_x, half_y in arena.walls.tolist():
        extents = [half_x, half_y, arena.wall_height / 2]
        _add_static(
            client,
            pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=extents, physicsClientId=client),
            pybullet.createVisualShape(
                pybullet.GEOM_BOX, halfExtents=extents, rgbaColor=[0.45, 0.50, 0.58, 1], physicsClientId=client
            ),
            [x, y, arena.wall_height / 2],
        )
    _add_static(
        client,
        pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER, radius=arena.lamp_radius, height=arena.lamp_height, physicsClientId=client
        ),
        pybullet.createVisualShape(
            pybullet.GEOM_CYLINDER,
            radius=arena.lamp_radius,
            length=arena.lamp_height,
            rgbaColor=[1.0, 0.80, 0.10, 1],
            physicsClientId=client,
        ),
        [*arena.lamp, arena.lamp_height / 2],
    )


def _add_static(client: int, collision: int, visual: int, position: list[float]) -> None:
    body = pybullet.createMultiBody(0, collision, visual, position, physicsClientId=client)
    pybullet.setCollisionFilterGroupMask(body, -1, WALL_GROUP, WALL_MASK, physicsClientId=client)
    pybullet.changeDynamics(body, -1, lateralFriction=0, restitution=0, physicsClientId=client)
