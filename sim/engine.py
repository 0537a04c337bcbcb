"""What an engine does: it moves a batch of robots and tells their state."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sim.arena import Arena, draw_episodes
from sim.checks import real_number, real_rows, whole_number
from sim.robot import ACTUATORS, CONTROL_HZ, MAX_SPEED, RADIUS, TOUCH
from sim.sensors import read
from sim.shapes import Shapes
from sim.task import Task

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Poses:
    """Poses of a batch of robots, one row per robot: x, y in m, the heading's angle (rad), cosine and sine.

    `clear` is the distance from each robot's centre to the nearest obstacle, m.
    """

    x: Floats
    y: Floats
    heading: Floats
    cos: Floats
    sin: Floats
    clear: Floats


@dataclass(frozen=True)
class State:
    """State of a batch of robots, one row per robot.

    Attributes:
        x, y: `[B]`, m.
        heading: `[B]`, rad in (-pi, pi].
        sensors: `[B, n]`, see `Task.sensors`.
        contact: `[B]`, whether the robot touches an obstacle.
        at_goals: `[B, goals]`, whether it touches the lamp of each goal.
        outside: `[B]`, whether it is outside the corral.
    """

    x: Floats
    y: Floats
    heading: Floats
    sensors: Floats
    contact: Flags
    at_goals: Flags
    outside: Flags


class Engine(ABC):
    """Simulates `size` robots, each in its own world: `reset` episodes, `drive` robots, `observe` their state.

    Slots 0 to `size` - 1 address the robots. They are independent: no slot changes a bit of another. An engine has
    `_place`, `_move` and `_poses`; all else, readings included, is the same for all engines. Close it, or use it as a
    context manager. Raises `ValueError` for a body that the engine does not have, or a size below 1.
    """

    bodies: ClassVar[tuple[str, ...]]
    """The robot's bodies that it can simulate; the first one is the default."""
    robots: ClassVar[int]
    """Robots to simulate at once, for speed."""

    def __init__(self, size: int, arena: Arena, task: Task, body: str | None = None, seed: int = 0) -> None:
        self.size = whole_number("robots", size, 1)
        self.arena, self.task, self.seed = arena, task, whole_number("seed", seed)
        self.body = self.find_body(body)
        self.obstacles = Shapes(arena.obstacles)
        self._goals = [Shapes([lamp for lamp in arena.lamps if lamp.colour == goal]) for goal in task.goals]
        self._pairs = [[lamp for lamp in arena.lamps if lamp.colour == light] for light in task.lights]
        self._noise = WheelNoise(self.size, arena.wheel_noise)

    @classmethod
    def find_body(cls, body: str | None) -> str:
        """The name of a body, by default the first. Raises `ValueError` that lists the known names."""
        if body is None:
            return cls.bodies[0]
        if body not in cls.bodies:
            hint = "; engine='bullet' has wheels" if body == "wheeled" else ""
            raise ValueError(f"unknown body {body!r}; expected one of {sorted(cls.bodies)}{hint}")
        return body

    def reset(self, slots: Integers, episodes: Integers) -> Floats:
        """Begin `episodes` `[B]` in `slots` `[B]`, and return their starts `[B, 3]` (x, y, heading)."""
        starts, generators = draw_episodes(self.arena, self.seed, episodes.tolist())
        self._noise.reset(slots, generators)
        self._place(slots, starts)
        return starts

    def drive(self, slots: Integers, commands: Floats) -> None:
        """Drive the robots in `slots` for one control step with `commands` `[B, 2]`, clipped to [-1, 1]."""
        self._move(slots, np.clip(commands, -1.0, 1.0) * MAX_SPEED * self._noise.draw(slots))

    def observe(self, slots: Integers) -> State:
        """The state of the robots in `slots`, in this order."""
        at = self._poses(slots)
        return State(
            x=at.x,
            y=at.y,
            heading=at.heading,
            sensors=read(self._pairs, self.obstacles, at.x, at.y, at.cos, at.sin, at.clear),
            contact=at.clear - RADIUS <= TOUCH,
            at_goals=np.stack([goal.distance(at.x, at.y) - RADIUS <= TOUCH for goal in self._goals], axis=1),
            outside=~self.arena.outline.holds(at.x, at.y),
        )

    @abstractmethod
    def _place(self, slots: Integers, starts: Floats) -> None:
        """Put robots at `starts` `[B, 3]`, at rest, as if they had just been built."""

    @abstractmethod
    def _move(self, slots: Integers, speeds: Floats) -> None:
        """Turn the wheels at `speeds` `[B, 2]` (m/s) for one control step."""

    @abstractmethod
    def _poses(self, slots: Integers) -> Poses:
        """Where the robots are."""

    @abstractmethod
    def picture(self, slot: int) -> NDArray[np.uint8]:
        """A picture `[H, W, 3]` of a robot in its arena, drawn by pybullet."""

    @property
    def closed(self) -> bool:
        """Whether the engine was closed."""
        return False

    def close(self) -> None:  # noqa: B027 (most engines hold nothing)
        """Free what the engine holds. A second call does nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class WheelNoise:
    """Draws a factor per wheel and control step: 1 + `spread` times a standard normal number.

    Each slot has the generator of its episode, so its factors depend on nothing else.
    """

    _BLOCK = 64  # control steps drawn at once; the factors do not depend on it

    def __init__(self, size: int, spread: float) -> None:
        self._spread = spread
        self._generators: list[np.random.Generator | None] = [None] * size
        self._ahead = np.ones((size, self._BLOCK, 2))
        self._next = np.zeros(size, dtype=np.int64)

    def reset(self, slots: Integers, generators: Sequence[np.random.Generator]) -> None:
        """Draw from these generators from now on."""
        for slot, generator in zip(slots.tolist(), generators, strict=True):
            self._generators[slot] = generator
        self._next[slots] = self._BLOCK

    def draw(self, slots: Integers) -> Floats:
        """The factors `[B, 2]` (left, right) of the next control step."""
        for slot in slots[self._next[slots] == self._BLOCK].tolist():
            generator = self._generators[slot]
            if generator is not None:
                self._ahead[slot] = 1.0 + self._spread * generator.standard_normal((self._BLOCK, 2))
            self._next[slot] = 0
        factors = self._ahead[slots, self._next[slots]]
        self._next[slots] += 1
        return factors


def control_steps(seconds: float) -> int:
    """The number of control steps in `seconds`. Raises `ValueError` unless it is at least 1."""
    seconds = real_number("time", seconds)
    steps = round(seconds * CONTROL_HZ) if math.isfinite(seconds * CONTROL_HZ) else 0
    if steps < 1:
        raise ValueError(f"{seconds} s; expected a finite time of at least one control step, {1 / CONTROL_HZ} s")
    return steps


def check_commands(commands: object, batch: int) -> Floats:
    """`commands` as float64 `[batch, 2]`. Raises `ValueError` for other shapes, complex numbers and text."""
    array = real_rows("commands", commands)
    if array.shape != (batch, len(ACTUATORS)):
        raise ValueError(f"commands have shape {array.shape}; expected {(batch, len(ACTUATORS))} (left, right wheel)")
    return array
