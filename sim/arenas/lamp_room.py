"""A closed room with two lamps of different colours."""

from sim.arena import Arena, square
from sim.arenas.registry import ARENAS
from sim.shapes import Lamp


def lamp_room(side: float = 4.0, apart: float = 2.0, wheel_noise: float = 0.3) -> Arena:
    """A square room without a gap, with a blue lamp and a yellow one, `apart` m in x and in y: first the blue one.

    A robot that has not found the first lamp cannot leave, as it can in `two_lamps`.
    """
    around, floor, outline = square(side, [])
    lamps = Lamp(-apart / 2, apart / 2, colour="blue"), Lamp(apart / 2, -apart / 2, colour="yellow")
    return Arena(tuple(around), lamps, floor, outline, wheel_noise=wheel_noise)


ARENAS["lamp_room"] = lamp_room
