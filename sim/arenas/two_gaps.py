"""A corral with two gaps in one wall, and the lamp between them, hidden from most of the inside."""

from sim.arena import Arena, square
from sim.arenas.registry import ARENAS
from sim.shapes import Lamp


def two_gaps(gap: float = 0.7, apart: float = 1.6, wheel_noise: float = 0.3) -> Arena:
    """A square corral of 3 m whose wall at x = 1.5 m has two gaps, `gap` m wide, with middles `apart` m apart."""
    around, floor, outline = square(3.0, [(-apart / 2, gap), (apart / 2, gap)])
    return Arena(tuple(around), (Lamp(2.3, 0.0),), floor, outline, wheel_noise=wheel_noise)


ARENAS["two_gaps"] = two_gaps
