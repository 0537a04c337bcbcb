"""A batch of robots, each in its own world: what rollouts and environments step."""

from __future__ import annotations

import math
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from sim._pybullet import pybullet
from sim.checks import real_number, real_rows, whole_number
from sim.corral import Arena, Start, build_corral, draw_episode, find_arena
from sim.robot import ACTUATORS, CONTROL_HZ, HEIGHT, MAX_SPEED, RADIUS, Body, Pose, find_body
from sim.sensors import SENSOR_HEIGHT, SensorArray

TOUCH = 0.005
"""A robot touches a wall or the lamp if the gap between their outlines is at most this wide, m."""


class World:
    """One pybullet DIRECT client (about 29 MB) with one arena and one robot.

    Close it, or use it as a context manager. Its client is disconnected when it is garbage collected, too.
    """

    def __init__(self, arena: Arena, body: str) -> None:
        make_body = find_body(body)
        _check_fit(arena)
        self.client = pybullet.connect(pybullet.DIRECT)
        if self.client < 0:
            raise RuntimeError("pybullet has no client left for another robot; close worlds or use fewer robots")
        self._disconnect = weakref.finalize(self, pybullet.disconnect, self.client)
        # At exit the process frees everything anyway, and pybullet may be unloaded already.
        self._disconnect.atexit = False
        try:
            build_corral(arena, self.client)
            self.body: Body = make_body(self.client)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Disconnect the client. A second call does nothing."""
        self._disconnect()
        self.client = -1

    def __enter__(self) -> World:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class WheelNoise:
    """Draws a factor per wheel and control step: 1 + `wheel_noise` times a standard normal number."""

    _BLOCK = 256  # control steps drawn at once; the factors do not depend on it

    def __init__(self, arena: Arena, generator: np.random.Generator) -> None:
        self._arena = arena
        self._generator = generator
        self._ahead: list[list[float]] = []

    def draw(self) -> list[float]:
        """The factors (left, right) of the next control step."""
        if not self._ahead:
            draws = 1.0 + self._arena.wheel_noise * self._generator.standard_normal((self._BLOCK, 2))
            self._ahead = draws[::-1].tolist()
        return self._ahead.pop()


@dataclass(frozen=True)
class State:
    """State of a batch of robots, one row per robot.

    Attributes:
        x, y: `[B]`, m.
        heading: `[B]`, rad in (-pi, pi].
        sensors: `[B, 3]`, see `sim.sensors.SENSORS`.
        contact: `[B]`, whether the robot touches a wall.
        at_lamp: `[B]`, whether it touches the lamp.
        outside: `[B]`, whether it is beyond the outer face of the wall with the gap.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    heading: NDArray[np.float64]
    sensors: NDArray[np.float64]
    contact: NDArray[np.bool_]
    at_lamp: NDArray[np.bool_]
    outside: NDArray[np.bool_]


class VectorSim:
    """Simulates `size` robots, each in its own world: `reset` episodes, `drive` robots, `observe` their state.

    Slots 0 to `size` - 1 address the robots. They are independent: no slot changes a bit of another.
    Raises `ValueError` for an unknown arena or body, or a size below 1.
    """

    def __init__(self, size: int, arena: str | Arena = "default", body: str = "planar", seed: int = 0) -> None:
        size = whole_number("robots", size, 1)
        self.arena = find_arena(arena)
        self.seed = whole_number("seed", seed)
        find_body(body)
        self._sensors = SensorArray(self.arena)
        self._walls = self.arena.walls
        self._noise: list[WheelNoise] = [WheelNoise(self.arena, np.random.default_rng(0))] * size
        self._poses: list[Pose] = [(0.0, 0.0, 1.0, 0.0)] * size
        self.worlds: list[World] = []
        try:
            for _ in range(size):
                self.worlds.append(World(self.arena, body))
        except BaseException:
            self.close()
            raise

    @property
    def closed(self) -> bool:
        """Whether the clients are disconnected."""
        return any(world.client < 0 for world in self.worlds)

    def reset(self, slot: int, episode: int) -> Start:
        """Begin `episode` in `slot` and return its start."""
        start, generator = draw_episode(self.arena, self.seed, episode)
        self._noise[slot] = WheelNoise(self.arena, generator)
        self._poses[slot] = self.worlds[slot].body.place(start)
        return start

    def drive(self, slots: Sequence[int], commands: NDArray[np.float64]) -> None:
        """Drive the robots in `slots` for one control step with `commands` `[B, 2]`, clipped to [-1, 1]."""
        speeds = np.clip(commands, -1.0, 1.0) * MAX_SPEED
        for slot, (left, right) in zip(slots, speeds.tolist(), strict=True):
            left_factor, right_factor = self._noise[slot].draw()
            self._poses[slot] = self.worlds[slot].body.drive(left * left_factor, right * right_factor)

    def observe(self, slots: Sequence[int]) -> State:
        """The state of the robots in `slots`, in this order."""
        poses = [self._poses[slot] for slot in slots]
        x, y, cos, sin = np.array(poses).T
        dx = np.maximum(np.abs(x[:, None] - self._walls[:, 0]) - self._walls[:, 2], 0.0)
        dy = np.maximum(np.abs(y[:, None] - self._walls[:, 1]) - self._walls[:, 3], 0.0)
        to_wall = np.sqrt((dx * dx + dy * dy).min(axis=1)) - RADIUS
        lamp_x, lamp_y = self.arena.lamp
        to_lamp = np.sqrt((x - lamp_x) ** 2 + (y - lamp_y) ** 2) - self.arena.lamp_radius - RADIUS
        return State(
            x=x,
            y=y,
            heading=np.array([math.atan2(pose[3], pose[2]) for pose in poses]),
            sensors=self._sensors.read([self.worlds[slot].client for slot in slots], x, y, cos, sin),
            contact=to_wall <= TOUCH,
            at_lamp=to_lamp <= TOUCH,
            outside=x > self.arena.side / 2 + self.arena.wall_thickness,
        )

    def close(self) -> None:
        """Disconnect all clients. A second call does nothing."""
        for world in self.worlds:
            world.close()

    def __enter__(self) -> VectorSim:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _check_fit(arena: Arena) -> None:
    if arena.gap <= 2 * RADIUS:
        raise ValueError(f"Arena.gap is {arena.gap} m; it must be wider than the robot, {2 * RADIUS} m")
    if not HEIGHT < arena.lamp_height < SENSOR_HEIGHT < arena.wall_height:
        raise ValueError(
            f"Arena.lamp_height is {arena.lamp_height} m and wall_height {arena.wall_height} m; the lamp must be "
            f"higher than the robot's centre ({HEIGHT} m) and lower than its beams ({SENSOR_HEIGHT} m), and the "
            "walls higher than the beams"
        )


def control_steps(seconds: float) -> int:
    """The number of control steps in `seconds`. Raises `ValueError` unless it is at least 1."""
    seconds = real_number("time", seconds)
    steps = round(seconds * CONTROL_HZ) if math.isfinite(seconds * CONTROL_HZ) else 0
    if steps < 1:
        raise ValueError(f"{seconds} s; expected a finite time of at least one control step, {1 / CONTROL_HZ} s")
    return steps


def check_commands(commands: object, batch: int) -> NDArray[np.float64]:
    """`commands` as float64 `[batch, 2]`. Raises `ValueError` for other shapes, complex numbers and text."""
    array = real_rows("commands", commands)
    if array.shape != (batch, len(ACTUATORS)):
        raise ValueError(f"commands have shape {array.shape}; expected {(batch, len(ACTUATORS))} (left, right wheel)")
    return array
