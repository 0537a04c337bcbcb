"""The robot in pybullet, as an ideal planar body or as wheels on a floor.

Both bodies have the same outline, track and speeds, and the same interface: results of the fast planar body can be
checked with the realistic wheeled one.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Protocol

from sim.arena import Start
from sim.engines._pybullet import pybullet
from sim.robot import CONTROL_HZ, RADIUS, SUBSTEPS, TRACK

WHEEL_RADIUS = 0.04
"""Radius of the wheels of the wheeled body, m."""
HEIGHT = 0.06
"""Height of the body's centre above the floor, m."""
FAR = 100.0
"""A height at which nothing is touched, m."""

WALL_GROUP, WALL_MASK = 1, 3
"""Obstacles, lamps and floor collide with everything. With other values `rayTestBatch` with a mask misses them."""
ROBOT_GROUP, ROBOT_MASK = 2, 1
"""Robots collide with the world; rays with the mask `WALL_GROUP` ignore them."""

Pose = tuple[float, float, float, float]
"""x, y in m, cosine and sine of the heading."""


class Body(Protocol):
    """A robot in its own pybullet client."""

    id: int
    """The body's id in its client, for cameras."""

    def __init__(self, client: int) -> None:
        """Build the robot in `client` and set the engine's parameters."""
        ...

    def place(self, start: Start) -> Pose:
        """Put the robot at `start`, at rest, as if it had just been built. Returns its pose."""
        ...

    def drive(self, left: float, right: float) -> Pose:
        """Turn the wheels at these speeds (m/s) for one control step. Returns the pose after it."""
        ...


class PlanarBody:
    """A body without ground contact: the wheel speeds set its velocity, and pybullet resolves its contacts.

    It collides as a sphere whose equator is below the lamp's top, so that contact normals are horizontal and the body
    neither tilts, rises nor sinks. It has no friction: contacts stop and deflect it, but never turn it.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / (CONTROL_HZ * SUBSTEPS),
            numSolverIterations=10,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        pybullet.setGravity(0, 0, 0, physicsClientId=client)
        collision = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=RADIUS, physicsClientId=client)
        visual = pybullet.createVisualShapeArray(
            shapeTypes=[pybullet.GEOM_CYLINDER, pybullet.GEOM_BOX],
            radii=[RADIUS, 0],
            lengths=[0.07, 0],
            halfExtents=[[0, 0, 0], [0.05, 0.03, 0.015]],
            visualFramePositions=[[0, 0, 0], [0.09, 0, 0.05]],
            rgbaColors=[[0.13, 0.35, 0.72, 1], [0.95, 0.95, 0.97, 1]],
            physicsClientId=client,
        )
        self.id = pybullet.createMultiBody(
            1.0,
            collision,
            visual,
            [0, 0, HEIGHT],
            physicsClientId=client,
        )
        pybullet.setCollisionFilterGroupMask(self.id, -1, ROBOT_GROUP, ROBOT_MASK, physicsClientId=client)
        pybullet.changeDynamics(
            self.id,
            -1,
            linearDamping=0,
            angularDamping=0,
            lateralFriction=0,
            rollingFriction=0,
            spinningFriction=0,
            restitution=0,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=client,
        )
        self._pose, self._sunk = _pose(self.id, client)

    def place(self, start: Start) -> Pose:
        """Put the robot at `start`, at rest, as if it had just been built. Returns its pose."""
        self._pose, self._sunk = _place(self.id, start, self._client)
        return self._pose

    def drive(self, left: float, right: float) -> Pose:
        """Turn the wheels at these speeds (m/s) for one control step. Returns the pose after it."""
        client, body = self._client, self.id
        speed, turn = (left + right) / 2, (right - left) / TRACK
        step = turn / (CONTROL_HZ * SUBSTEPS)
        # Each physics step goes straight along the middle heading of its arc.
        heading = math.atan2(self._pose[3], self._pose[2]) + step / 2
        # Contact normals are horizontal only up to rounding, which would sink the body by millimetres in minutes.
        rise = self._sunk * CONTROL_HZ
        for _ in range(SUBSTEPS):
            velocity = (speed * math.cos(heading), speed * math.sin(heading), rise)
            pybullet.resetBaseVelocity(body, velocity, (0.0, 0.0, turn), client)
            pybullet.stepSimulation(client)
            heading += step
        self._pose, self._sunk = _pose(body, client)
        return self._pose


class WheeledBody:
    """Two driven wheels and two casters on a floor, from `robot.urdf`; motors hold the commanded wheel speeds."""

    _SUBSTEPS = 6
    _TORQUE = 0.3  # N m per wheel: full speed within one control step, but stalls at a wall
    _GRIP = 1.0

    def __init__(self, client: int) -> None:
        self._client = client
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / CONTROL_HZ,
            numSubSteps=self._SUBSTEPS,
            numSolverIterations=10,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        # A plane without a visual shape is drawn as a checkerboard; a tiny sphere under the floor prevents that.
        speck = pybullet.createVisualShape(
            pybullet.GEOM_SPHERE, radius=0.001, visualFramePosition=[0, 0, -0.5], physicsClientId=client
        )
        floor = pybullet.createMultiBody(0, plane, speck, physicsClientId=client)
        pybullet.setCollisionFilterGroupMask(floor, -1, WALL_GROUP, WALL_MASK, physicsClientId=client)
        pybullet.changeDynamics(floor, -1, lateralFriction=1, restitution=0, physicsClientId=client)
        self.id = pybullet.loadURDF(
            str(Path(__file__).with_name("robot.urdf")),
            [0, 0, HEIGHT],
            physicsClientId=client,
        )
        joints = {
            pybullet.getJointInfo(self.id, i, physicsClientId=client)[1]: i
            for i in range(pybullet.getNumJoints(self.id, physicsClientId=client))
        }
        self._wheels = [joints[b"left_axle"], joints[b"right_axle"]]
        for link in range(-1, len(joints)):
            pybullet.setCollisionFilterGroupMask(self.id, link, ROBOT_GROUP, ROBOT_MASK, physicsClientId=client)
            pybullet.changeDynamics(
                self.id,
                link,
                linearDamping=0,
                angularDamping=0,
                jointDamping=0,
                lateralFriction=self._GRIP if link in self._wheels else 0,
                rollingFriction=0,
                spinningFriction=0,
                restitution=0,
                activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
                physicsClientId=client,
            )

    def place(self, start: Start) -> Pose:
        """Put the robot at `start`, at rest, as if it had just been built. Returns its pose."""
        for wheel in self._wheels:
            pybullet.resetJointState(self.id, wheel, 0.0, 0.0, physicsClientId=self._client)
        return _place(self.id, start, self._client)[0]

    def drive(self, left: float, right: float) -> Pose:
        """Turn the wheels at these speeds (m/s) for one control step. Returns the pose after it."""
        pybullet.setJointMotorControlArray(
            self.id,
            self._wheels,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[left / WHEEL_RADIUS, right / WHEEL_RADIUS],
            forces=[self._TORQUE, self._TORQUE],
            physicsClientId=self._client,
        )
        pybullet.stepSimulation(self._client)
        return _pose(self.id, self._client)[0]


BODIES: dict[str, type[PlanarBody] | type[WheeledBody]] = {"planar": PlanarBody, "wheeled": WheeledBody}
"""Bodies by name."""


def _place(body: int, start: Start, client: int) -> tuple[Pose, float]:
    upright = [0.0, 0.0, math.sin(start.heading / 2), math.cos(start.heading / 2)]
    # A contact outlives a jump to the other side of what was touched, and pushes the robot; one to above it ends it.
    pybullet.resetBasePositionAndOrientation(body, [start.x, start.y, FAR], upright, client)
    pybullet.performCollisionDetection(client)
    pybullet.resetBasePositionAndOrientation(body, [start.x, start.y, HEIGHT], upright, client)
    pybullet.resetBaseVelocity(body, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), client)
    return _pose(body, client)


def _pose(body: int, client: int) -> tuple[Pose, float]:
    """The pose, and how far the body's centre is below `HEIGHT`."""
    (x, y, z), (qx, qy, qz, qw) = pybullet.getBasePositionAndOrientation(body, client)
    # The body's x axis seen from above; tilting shortens it.
    cos, sin = 1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy + qw * qz)
    length = math.sqrt(cos * cos + sin * sin)
    return (x, y, cos / length, sin / length), HEIGHT - z
