"""Many robots, each alone in a world of its own, stepped together: the core of rollouts and environments."""

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
"""A robot touches a wall or the lamp where the gap between the outlines is at most this wide, m."""


class World:
    """One pybullet DIRECT client (about 29 MB) with one arena and one robot. `close` it, or use it in `with`.

    A world that is dropped without that disconnects its client as well.
    """

    def __init__(self, arena: Arena, body: str) -> None:
        make_body = find_body(body)
        _check_fit(arena)
        self.client = pybullet.connect(pybullet.DIRECT)
        if self.client < 0:
            raise RuntimeError("pybullet has no client left for another robot; close some worlds or use fewer robots")
        self._disconnect = weakref.finalize(self, pybullet.disconnect, self.client)
        # At exit the process gives everything back by itself, and pybullet may be gone already.
        self._disconnect.atexit = False
        try:
            build_corral(arena, self.client)
            self.body: Body = make_body(self.client)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Disconnect the client; closing twice is fine."""
        self._disconnect()
        self.client = -1

    def __enter__(self) -> World:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class WheelNoise:
    """Factors on the two wheel speeds, one pair a control step: 1 + `wheel_noise` times a standard normal draw."""

    _BLOCK = 256  # drawn ahead at once; a longer episode begins like a shorter one whatever the block

    def __init__(self, arena: Arena, generator: np.random.Generator) -> None:
        self._arena = arena
        self._generator = generator
        self._ahead: list[list[float]] = []

    def draw(self) -> list[float]:
        """Factors (left, right) for the next control step."""
        if not self._ahead:
            draws = 1.0 + self._arena.wheel_noise * self._generator.standard_normal((self._BLOCK, 2))
            self._ahead = draws[::-1].tolist()
        return self._ahead.pop()


@dataclass(frozen=True)
class State:
    """What a batch of robots is in, one row a robot.

    Attributes:
        x, y: `[B]`, m.
        heading: `[B]`, rad in (-pi, pi].
        sensors: `[B, 3]`, see `sim.sensors.SENSORS`.
        contact: `[B]`, touches a wall.
        at_lamp: `[B]`, touches the lamp.
        outside: `[B]`, beyond the outer face of the wall with the gap, through which the only way leads.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    heading: NDArray[np.float64]
    sensors: NDArray[np.float64]
    contact: NDArray[np.bool_]
    at_lamp: NDArray[np.bool_]
    outside: NDArray[np.bool_]


class VectorSim:
    """`size` robots in worlds of their own: give them episodes, command them, read their state.

    Robots are addressed by slot. Slots are independent: what happens in one never changes a bit in another.
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
        """Begin `episode` in `slot`; returns its start."""
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
        """The state of the robots in `slots`, in that order."""
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
        """Disconnect all clients; closing twice is fine."""
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
        raise ValueError(f"Arena.gap is {arena.gap} m; the robot is {2 * RADIUS} m wide and needs more to get out")
    if not HEIGHT < arena.lamp_height < SENSOR_HEIGHT < arena.wall_height:
        raise ValueError(
            f"Arena.lamp_height is {arena.lamp_height} m and wall_height {arena.wall_height} m; the lamp must be "
            f"higher than the robot's centre ({HEIGHT} m) and lower than its beams ({SENSOR_HEIGHT} m), walls higher"
        )


def control_steps(seconds: float) -> int:
    """Number of control steps in `seconds`. Raises `ValueError` unless there is at least one."""
    seconds = real_number("time", seconds)
    steps = round(seconds * CONTROL_HZ) if math.isfinite(seconds * CONTROL_HZ) else 0
    if steps < 1:
        raise ValueError(f"{seconds} s; expected a finite time of at least one control step, {1 / CONTROL_HZ} s")
    return steps


def check_commands(commands: object, batch: int) -> NDArray[np.float64]:
    """`commands` as float64 `[batch, 2]`. Raises `ValueError` for another shape, complex numbers and text."""
    array = real_rows("commands", commands)
    if array.shape != (batch, len(ACTUATORS)):
        raise ValueError(f"commands have shape {array.shape}; expected {(batch, len(ACTUATORS))} (left, right wheel)")
    return array
