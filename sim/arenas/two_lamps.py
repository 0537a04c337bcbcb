"""A corral with a lamp inside and one of another colour outside."""

from sim.arena import Arena, square
from sim.arenas.registry import ARENAS
from sim.shapes import Lamp


def two_lamps(side: float = 3.6, gap: float = 1.0, wheel_noise: float = 0.3) -> Arena:
    """A square corral with a blue lamp in its far corner and a yellow one beyond the gap: first the blue one."""
    around, floor, outline = square(side, [(0.0, gap)])
    half = side / 2
    lamps = Lamp(-half / 2, half / 2, colour="blue"), Lamp(half + 0.8, 0.0, colour="yellow")
    return Arena(tuple(around), lamps, floor, outline, wheel_noise=wheel_noise)


ARENAS["two_lamps"] = two_lamps
