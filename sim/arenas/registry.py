"""All arenas by name."""

from __future__ import annotations

from collections.abc import Callable

from sim.arena import Arena

ARENAS: dict[str, Callable[..., Arena]] = {}
"""Functions that make an arena, by name; parameters of a function are the settings of the arena.

A user's own arena is found if it is added: `sim.ARENAS["hall"] = hall`.
"""


def find_arena(arena: str | Arena) -> Arena:
    """Find an arena by name; an `Arena` is returned as it is. Raises `ValueError` that lists the known names."""
    if isinstance(arena, Arena):
        return arena
    if not isinstance(arena, str) or arena not in ARENAS:
        raise ValueError(f"unknown arena {arena!r}; expected an Arena or one of {sorted(ARENAS)}")
    return ARENAS[arena]()
