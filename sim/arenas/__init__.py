"""Arenas by name: each is a function whose parameters are its settings, in a short file of its own."""

from sim.arenas import clutter, corral, lamp_room, two_gaps, two_lamps
from sim.arenas.registry import ARENAS, find_arena

__all__ = ["ARENAS", "clutter", "corral", "find_arena", "lamp_room", "two_gaps", "two_lamps"]
