"""The truth: each robot in its own pybullet client."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim.arena import Arena, Start
from sim.engine import Engine, Floats, Integers, Poses
from sim.engines.bodies import Pose
from sim.engines.camera import render_rgb
from sim.engines.world import World
from sim.robot import BODIES
from sim.task import Task


class Bullet(Engine):
    """Robots in pybullet: `planar` is moved by its velocities, `wheeled` stands on wheels. About 29 MB each."""

    bodies = BODIES
    robots = 64

    def __init__(self, size: int, arena: Arena, task: Task, body: str | None = None, seed: int = 0) -> None:
        super().__init__(size, arena, task, body, seed)
        self._last: list[Pose] = [(0.0, 0.0, 1.0, 0.0)] * self.size
        self.worlds: list[World] = []
        try:
            for _ in range(self.size):
                self.worlds.append(World(arena, self.body))
        except BaseException:
            self.close()
            raise

    @property
    def closed(self) -> bool:
        """Whether the clients are disconnected."""
        return any(world.client < 0 for world in self.worlds)

    def close(self) -> None:
        """Disconnect all clients. A second call does nothing."""
        for world in self.worlds:
            world.close()

    def picture(self, slot: int) -> NDArray[np.uint8]:
        """See `Engine.picture`."""
        return render_rgb(self.worlds[slot].client, self.arena)

    def _place(self, slots: Integers, starts: Floats) -> None:
        for slot, start in zip(slots.tolist(), starts.tolist(), strict=True):
            self._last[slot] = self.worlds[slot].body.place(Start(*start))

    def _move(self, slots: Integers, speeds: Floats) -> None:
        for slot, (left, right) in zip(slots.tolist(), speeds.tolist(), strict=True):
            self._last[slot] = self.worlds[slot].body.drive(left, right)

    def _poses(self, slots: Integers) -> Poses:
        poses = [self._last[slot] for slot in slots.tolist()]
        x, y, cos, sin = np.array(poses).reshape(-1, 4).T
        heading = np.array([math.atan2(pose[3], pose[2]) for pose in poses])
        return Poses(x, y, heading, cos, sin, self.obstacles.distance(x, y))
