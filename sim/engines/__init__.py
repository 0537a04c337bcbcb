"""Engines by name. `bullet` is the truth, `vector` is fast.

`bullet` needs pybullet, which is imported when the engine is chosen.
"""

from __future__ import annotations

from sim.engine import Engine
from sim.engines.vector import Vector

NAMES = ("vector", "bullet")
"""The names of the engines; the first one is the default."""


def find_engine(engine: str) -> type[Engine]:
    """Find an engine by name. Raises `ValueError` that lists the known names."""
    if engine == "vector":
        return Vector
    if engine == "bullet":
        from sim.engines.bullet import Bullet

        return Bullet
    raise ValueError(f"unknown engine {engine!r}; expected one of {sorted(NAMES)}")
