"""The shapes that an arena is made of, seen from above: boxes, pillars and lamps.

Lengths are in metres.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Box:
    """A rectangle with its sides along x and y: its centre, and half its extent in x and y."""

    x: float
    y: float
    half_x: float
    half_y: float

    def __post_init__(self) -> None:
        _check(self, positive=("half_x", "half_y"))

    def holds(self, x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Whether points lie inside or on the edge, `[...]`."""
        return (np.abs(x - self.x) <= self.half_x) & (np.abs(y - self.y) <= self.half_y)


@dataclass(frozen=True)
class Pillar:
    """A round obstacle: its centre and radius."""

    x: float
    y: float
    radius: float

    def __post_init__(self) -> None:
        _check(self, positive=("radius",))


@dataclass(frozen=True)
class Lamp:
    """A lamp: its axis, radius and colour. It stops robots, but it is lower than the beams of their sensors."""

    x: float
    y: float
    radius: float = 0.15
    colour: str = "yellow"

    def __post_init__(self) -> None:
        _check(self, positive=("radius",))


Obstacle = Box | Pillar


class Shapes:
    """Distances from points to `S` shapes, and along rays.

    Sums, products, divisions and square roots are all that touches a row, so its bits depend on no neighbour.
    """

    def __init__(self, shapes: Sequence[Box | Pillar | Lamp]) -> None:
        self._shapes = shapes
        # A round shape is a box without extent whose surface is `radius` away from it.
        rows = [
            (shape.x, shape.y, shape.half_x, shape.half_y, 0.0)
            if isinstance(shape, Box)
            else (shape.x, shape.y, 0.0, 0.0, shape.radius)
            for shape in shapes
        ]
        self._x, self._y, self._half_x, self._half_y, self._radius = np.array(rows).reshape(-1, 5, 1).transpose(1, 0, 2)

    def offsets(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """How far points `[B]` are from the shapes: dx, dy and the distance to the surface, each `[S, B]`.

        dx and dy lead to a point from the nearest point of a box, or from the centre of a round shape.
        """
        dx, dy = x - self._x, y - self._y
        dx -= np.minimum(np.maximum(dx, -self._half_x), self._half_x)
        dy -= np.minimum(np.maximum(dy, -self._half_y), self._half_y)
        return dx, dy, np.sqrt(dx * dx + dy * dy) - self._radius

    def distance(self, x: Floats, y: Floats) -> Floats:
        """Distances `[B]` from points to the nearest surface; infinite without shapes."""
        return self.offsets(x, y)[2].min(axis=0, initial=np.inf)

    def first_hit(self, x: Floats, y: Floats, to_x: Floats, to_y: Floats) -> Floats:
        """The share of the way from (x, y) to (to_x, to_y) at which rays `[R]` enter the first shape, else 1."""
        way_x, way_y = to_x - x, to_y - y
        # A ray along an axis never reaches the other sides: 1 / tiny is large, but no infinity that makes NaN with 0.
        per_x, per_y = 1.0 / np.where(way_x == 0, 1e-300, way_x), 1.0 / np.where(way_y == 0, 1e-300, way_y)
        first = np.ones(len(x))
        for shape in self._shapes:
            if isinstance(shape, Box):
                hit = _meets_box(shape, x, y, per_x, per_y)
            else:
                hit = _meets_circle(shape.x - x, shape.y - y, way_x, way_y, shape.radius)
            np.minimum(first, hit, out=first)
        return first


def _meets_box(box: Box, x: Floats, y: Floats, per_x: Floats, per_y: Floats) -> Floats:
    """The share of its way at which a ray enters a box, 1 or more if it does not."""
    to_left, to_right = (box.x - box.half_x - x) * per_x, (box.x + box.half_x - x) * per_x
    to_low, to_high = (box.y - box.half_y - y) * per_y, (box.y + box.half_y - y) * per_y
    enters = np.maximum(np.minimum(to_left, to_right), np.minimum(to_low, to_high))
    leaves = np.minimum(np.maximum(to_left, to_right), np.maximum(to_low, to_high))
    return np.where((enters <= leaves) & (leaves >= 0), np.maximum(enters, 0.0), 1.0)


def _meets_circle(dx: Floats, dy: Floats, way_x: Floats, way_y: Floats, radius: float) -> Floats:
    """The share of its way at which a ray enters a circle whose middle is at (`dx`, `dy`) from its start, else 1."""
    square = way_x * way_x + way_y * way_y
    along, across = dx * way_x + dy * way_y, dx * way_y - dy * way_x
    inner = radius * radius * square - across * across
    enters = (along - np.sqrt(np.maximum(inner, 0.0))) / square
    return np.where((inner >= 0) & (along >= 0), np.maximum(enters, 0.0), 1.0)


def finite(shape: object, names: Iterable[str]) -> None:
    """Raise `ValueError` that names the field unless these fields are finite numbers."""
    for name in names:
        value = getattr(shape, name)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"{type(shape).__name__}.{name} is {value!r}; expected a finite number")


def _check(shape: Box | Pillar | Lamp, positive: tuple[str, ...]) -> None:
    finite(shape, [field.name for field in fields(shape) if field.name != "colour"])
    for name in positive:
        if getattr(shape, name) <= 0:
            raise ValueError(f"{type(shape).__name__}.{name} is {getattr(shape, name)}; expected a length above 0 m")
