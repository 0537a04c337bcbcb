"""The corral of the paper: a square with one gap, and a lamp beyond it. Neubert et al. 2016, section IV.

The teacher solves `default`; each of the others is harder in one respect.
"""

from functools import partial

from sim.arena import Arena, square
from sim.arenas.registry import ARENAS
from sim.shapes import Box, Lamp, Pillar


def corral(
    side: float = 3.0,
    gap: float = 1.0,
    gap_offset: float = 0.0,
    lamp_beyond: float = 0.8,
    lamp_offset: float = 0.0,
    lamp_radius: float = 0.15,
    start_margin: float = 0.3,
    wheel_noise: float = 0.3,
    within: tuple[Box | Pillar, ...] = (),
) -> Arena:
    """A square corral, centred on the origin, with a gap in its wall at x = +side/2.

    Args:
        side: inner edge length, m.
        gap: width of the opening, m.
        gap_offset: y of its middle, m.
        lamp_beyond: distance from that wall's inner face to the lamp's axis, m.
        lamp_offset: y of the lamp's axis relative to the opening's middle, m.
        lamp_radius: m.
        start_margin: smallest distance from a start to a wall, m.
        wheel_noise: see `Arena`.
        within: obstacles inside.
    """
    around, floor, outline = square(side, [(gap_offset, gap)])
    lamp = Lamp(side / 2 + lamp_beyond, gap_offset + lamp_offset, lamp_radius)
    return Arena((*around, *within), (lamp,), floor, outline, start_margin, wheel_noise)


ARENAS["default"] = corral
ARENAS["narrow"] = partial(corral, gap=0.7)
ARENAS["offset_lamp"] = partial(corral, lamp_offset=1.0)
ARENAS["large"] = partial(corral, side=4.8)
