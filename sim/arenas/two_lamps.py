"""A corral with a lamp inside and one of another colour outside."""

from sim.arena import WALL_THICKNESS, Arena, walls
from sim.arenas.registry import ARENAS
from sim.shapes import Box, Lamp


def two_lamps(side: float = 3.6, gap: float = 1.0, wheel_noise: float = 0.3) -> Arena:
    """A square corral with a blue lamp in its far corner and a yellow one beyond the gap: first the blue one."""
    half = side / 2
    floor, outline = Box(0.0, 0.0, half, half), Box(0.0, 0.0, half + WALL_THICKNESS, half + WALL_THICKNESS)
    lamps = Lamp(-half / 2, half / 2, colour="blue"), Lamp(half + 0.8, 0.0, colour="yellow")
    return Arena(tuple(walls(floor, [(0.0, gap)])), lamps, floor, outline, wheel_noise=wheel_noise)


ARENAS["two_lamps"] = two_lamps
