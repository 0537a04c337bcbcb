"""Pictures of a pybullet world, rendered in software: they need neither a display nor OpenGL."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.arena import Arena
from sim.engines._pybullet import pybullet


def render_rgb(client: int, arena: Arena, width: int = 480, height: int = 360) -> NDArray[np.uint8]:
    """Render the world of `client` from obliquely above as `[height, width, 3]` uint8; x grows to the right.

    Raises `ValueError` for a size below 1 pixel.
    """
    if width < 1 or height < 1:
        raise ValueError(f"a picture of {width} x {height} pixels; expected at least 1 x 1")
    low, high, *_ = arena.extent()
    length, wide = high - low + 0.3, 2 * arena.floor.half_y
    view = pybullet.computeViewMatrixFromYawPitchRoll(
        cameraTargetPosition=[(low + high) / 2 - 0.1, arena.floor.y - 0.05 * wide, 0.0],
        distance=1.06 * length,
        yaw=0.0,
        pitch=-62.0,
        roll=0.0,
        upAxisIndex=2,
    )
    projection = pybullet.computeProjectionMatrixFOV(fov=45.0, aspect=width / height, nearVal=0.1, farVal=6.0 * length)
    image = pybullet.getCameraImage(
        width,
        height,
        viewMatrix=view,
        projectionMatrix=projection,
        lightDirection=[-0.6, -1.0, 2.0],
        lightAmbientCoeff=0.65,
        lightDiffuseCoeff=0.4,
        lightSpecularCoeff=0.0,
        shadow=0,
        renderer=pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
    )
    return np.asarray(image[2], dtype=np.uint8).reshape(height, width, 4)[:, :, :3].copy()
