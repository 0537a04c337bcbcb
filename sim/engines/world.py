"""An arena and a robot in a pybullet client."""

from __future__ import annotations

import weakref
from types import TracebackType

from sim.arena import Arena
from sim.engines._pybullet import pybullet
from sim.engines.bodies import BODIES, HEIGHT, WALL_GROUP, WALL_MASK, Body
from sim.shapes import Box

SENSOR_HEIGHT = 0.16
"""Height of all beams, m: above the lamps, below the top of the walls."""
LAMP_HEIGHT = 0.1
"""Height of a lamp, m: above the robot's centre, so that it stops the robot, and below the beams."""
WALL_HEIGHT = 0.25
"""Height of walls, boxes and pillars, m."""
assert HEIGHT < LAMP_HEIGHT < SENSOR_HEIGHT < WALL_HEIGHT

COLOURS = {"yellow": (1.0, 0.80, 0.10, 1.0), "blue": (0.20, 0.45, 0.90, 1.0), "red": (0.85, 0.20, 0.20, 1.0)}
"""What lamps look like; others are white."""
_WALL_COLOUR = (0.45, 0.50, 0.58, 1.0)


class World:
    """One pybullet DIRECT client (about 29 MB) with one arena and one robot.

    Close it, or use it as a context manager. Its client is disconnected when it is garbage collected, too.
    """

    def __init__(self, arena: Arena, body: str) -> None:
        self.client = pybullet.connect(pybullet.DIRECT)
        if self.client < 0:
            raise RuntimeError("pybullet has no client left for another robot; close worlds or use fewer robots")
        self._disconnect = weakref.finalize(self, pybullet.disconnect, self.client)
        # At exit the process frees everything anyway, and pybullet may be unloaded already.
        self._disconnect.atexit = False
        try:
            build(arena, self.client)
            self.body: Body = BODIES[body](self.client)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Disconnect the client. A second call does nothing."""
        self._disconnect()
        self.client = -1

    def __enter__(self) -> World:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def build(arena: Arena, client: int) -> None:
    """Add the obstacles and the lamps of `arena` to the pybullet `client`, as fixed bodies without friction.

    The floor is only visual: a body that stands on the ground adds its own.
    """
    reach = 4 * max(arena.floor.half_x, arena.floor.half_y)
    floor = pybullet.createVisualShape(
        pybullet.GEOM_BOX,
        halfExtents=[reach, reach, 0.01],
        rgbaColor=[0.90, 0.90, 0.87, 1],
        specularColor=[0, 0, 0],
        physicsClientId=client,
    )
    pybullet.createMultiBody(0, -1, floor, [0, 0, -0.01], physicsClientId=client)
    for obstacle in arena.obstacles:
        if isinstance(obstacle, Box):
            extents = [obstacle.half_x, obstacle.half_y, WALL_HEIGHT / 2]
            collision = pybullet.createCollisionShape(
                pybullet.GEOM_BOX, halfExtents=extents, physicsClientId=client
            )  # fmt: skip
            visual = pybullet.createVisualShape(
                pybullet.GEOM_BOX, halfExtents=extents, rgbaColor=_WALL_COLOUR, physicsClientId=client
            )
            _add_static(client, collision, visual, [obstacle.x, obstacle.y, WALL_HEIGHT / 2])
        else:
            _add_cylinder(client, obstacle.x, obstacle.y, obstacle.radius, WALL_HEIGHT, _WALL_COLOUR)
    for lamp in arena.lamps:
        colour = COLOURS.get(lamp.colour, (1.0, 1.0, 1.0, 1.0))
        _add_cylinder(client, lamp.x, lamp.y, lamp.radius, LAMP_HEIGHT, colour)


def _add_cylinder(
    client: int, x: float, y: float, radius: float, height: float, colour: tuple[float, float, float, float]
) -> None:
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_CYLINDER, radius=radius, height=height, physicsClientId=client
    )
    visual = pybullet.createVisualShape(
        pybullet.GEOM_CYLINDER, radius=radius, length=height, rgbaColor=colour, physicsClientId=client
    )
    _add_static(client, collision, visual, [x, y, height / 2])


def _add_static(client: int, collision: int, visual: int, position: list[float]) -> None:
    body = pybullet.createMultiBody(0, collision, visual, position, physicsClientId=client)
    pybullet.setCollisionFilterGroupMask(body, -1, WALL_GROUP, WALL_MASK, physicsClientId=client)
    pybullet.changeDynamics(body, -1, lateralFriction=0, restitution=0, physicsClientId=client)
