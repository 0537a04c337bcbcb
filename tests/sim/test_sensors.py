import math

import numpy as np
import pybullet
import pytest

import sim
from sim.corral import ROBOT_GROUP, WALL_GROUP, Start
from sim.robot import RADIUS
from sim.sensors import DISTANCE_MAX, LIGHT_INWARD, LIGHT_MAX, LIGHT_MOUNT, LIGHT_OUTWARD, LIGHT_REACH, SensorArray
from sim.sensors import SENSOR_HEIGHT as Z
from sim.vector_sim import World

ARENA = sim.Arena(side=3.0, gap=1.0, lamp_beyond=0.8)
LAMP = (2.3, 0.0)


def read(x: float, y: float, heading: float, arena: sim.Arena = ARENA, body: str = "planar") -> list[float]:
    with World(arena, body) as world:
        world.body.place(Start(x, y, heading))
        row = [np.array([value]) for value in (x, y, math.cos(heading), math.sin(heading))]
        return SensorArray(arena).read([world.client], *row)[0].tolist()


def to_lamp(x: float, y: float, heading: float, side: float) -> float:
    """Distance from the left (+1) or right (-1) sensor to the lamp's surface, from the definition."""
    mount = heading + side * LIGHT_MOUNT
    at = x + RADIUS * math.cos(mount), y + RADIUS * math.sin(mount)
    return math.dist(at, LAMP) - ARENA.lamp_radius


@pytest.mark.parametrize("body", ["planar", "wheeled"])
@pytest.mark.parametrize(("x", "y", "heading"), [(0.0, 0.0, 0.0), (-1.0, 0.1, 0.1), (1.2, -0.2, 0.3), (2.0, 0.02, 0.1)])
def test_both_lights_read_the_distance_to_the_lamp_that_the_robot_faces(
    x: float, y: float, heading: float, body: str
) -> None:
    left, right, _ = read(x, y, heading, body=body)
    assert left == pytest.approx(to_lamp(x, y, heading, 1), abs=1e-6)
    assert right == pytest.approx(to_lamp(x, y, heading, -1), abs=1e-6)


def test_a_wall_hides_the_lamp() -> None:
    heading = math.atan2(0.0 - 1.2, 2.3 - 0.9)
    assert read(0.9, 1.2, heading)[:2] == [LIGHT_MAX, LIGHT_MAX]
    wide = sim.Arena(side=3.0, gap=2.9, lamp_beyond=0.8)
    assert max(read(0.9, 1.2, heading, wide)[:2]) < 2.0


def test_the_edge_of_the_gap_hides_the_lamp_from_one_eye() -> None:
    # The line from the left eye passes the gap's upper edge outside, that from the right eye inside.
    at = next(y for y in np.linspace(0.6, 1.3, 200) if sum(r < LIGHT_MAX for r in read(0.8, y, -0.5)[:2]) == 1)
    left, right, _ = read(0.8, float(at), -0.5)
    assert left == LIGHT_MAX
    assert right == pytest.approx(to_lamp(0.8, float(at), -0.5, -1), abs=1e-6)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("edge", ["inward", "outward"])
def test_each_light_sees_as_far_as_the_edge_of_its_cone(side: float, edge: str) -> None:
    # The bearing of the lamp as the sensor itself sees it, left positive.
    bearing = side * LIGHT_OUTWARD if edge == "outward" else -side * LIGHT_INWARD
    column = 0 if side > 0 else 1
    for beyond, lit in ((-0.01, True), (0.01, False)):
        heading = -(bearing + beyond * math.copysign(1, bearing))
        # Placed so that the lamp lies 0.3 m from the sensor along world x: no wall between.
        mount = heading + side * LIGHT_MOUNT
        x, y = LAMP[0] - 0.45 - RADIUS * math.cos(mount), LAMP[1] - RADIUS * math.sin(mount)
        reading = read(x, y, heading)[column]
        assert reading == pytest.approx(0.3 if lit else LIGHT_MAX, abs=1e-6)


def test_light_has_a_reach_and_lit_readings_stay_clear_of_the_maximum() -> None:
    far = sim.Arena(side=8.0, gap=7.0)  # The lamp is at x = 4.8.
    near_x = 4.8 - 0.15 - LIGHT_REACH + 0.05
    assert max(read(near_x, 0.0, 0.0, far)[:2]) < LIGHT_REACH
    assert read(near_x - 0.2, 0.0, 0.0, far)[:2] == [LIGHT_MAX, LIGHT_MAX]
    assert LIGHT_MAX - LIGHT_REACH >= LIGHT_MAX / 16


@pytest.mark.parametrize("body", ["planar", "wheeled"])
def test_distance_is_measured_from_the_rim_to_the_wall(body: str) -> None:
    assert read(1.5 - RADIUS - 0.3, 1.0, 0.0, body=body)[2] == pytest.approx(0.3, abs=1e-5)
    assert read(-0.2, 1.5 - RADIUS - 0.12, math.pi / 2, body=body)[2] == pytest.approx(0.12, abs=1e-5)


def test_side_beams_see_a_wall_that_the_middle_one_misses() -> None:
    # Along the wall, 0.25 m from it: only the left beam, 0.4 rad to the left, meets it.
    assert read(0.0, 1.25, 0.0)[2] == pytest.approx(0.25 / math.sin(0.4) - RADIUS, abs=1e-5)
    assert read(0.0, -1.25, 0.0)[2] == pytest.approx(0.25 / math.sin(0.4) - RADIUS, abs=1e-5)
    assert read(0.0, 1.1, 0.0)[2] == DISTANCE_MAX


def test_distance_is_at_its_maximum_where_nothing_is_hit() -> None:
    assert read(0.0, 0.0, 1.0)[2] == DISTANCE_MAX
    # Through the middle of the gap, and at the lamp, which is lower than the beams.
    assert read(1.2, 0.0, 0.0)[2] == DISTANCE_MAX
    assert read(1.99, 0.0, 0.0)[2] == DISTANCE_MAX


def test_masked_rays_hit_walls_and_not_robots() -> None:
    with World(ARENA, "planar") as world:
        world.body.place(Start(0.0, 1.0, 0.0))
        low = 0.06
        through = [[-1.0, 1.0, low]], [[2.0, 1.0, low]]
        (wall,) = pybullet.rayTestBatch(*through, collisionFilterMask=WALL_GROUP, physicsClientId=world.client)
        (robot,) = pybullet.rayTestBatch(*through, collisionFilterMask=ROBOT_GROUP, physicsClientId=world.client)
        assert wall[0] not in (-1, world.body.id)
        assert wall[3][0] == pytest.approx(1.5, abs=1e-5)
        assert robot[0] == world.body.id
        assert robot[3][0] == pytest.approx(-RADIUS, abs=1e-5)
        # What the walls' own mask is for: without the rays' group in it they are missed.
        pybullet.setCollisionFilterGroupMask(wall[0], -1, WALL_GROUP, ROBOT_GROUP, physicsClientId=world.client)
        (missed,) = pybullet.rayTestBatch(*through, collisionFilterMask=WALL_GROUP, physicsClientId=world.client)
        assert missed[0] == -1


def test_beams_pass_above_the_lamp_and_below_the_top_of_the_walls() -> None:
    for arena in sim.ARENAS.values():
        assert arena.lamp_height < Z < arena.wall_height


def test_readings_stay_in_their_declared_range() -> None:
    generator = np.random.default_rng(0)
    low, high = np.array([(sensor.low, sensor.high) for sensor in sim.SENSORS]).T
    with World(ARENA, "planar") as world:
        array = SensorArray(ARENA)
        x, y, heading = generator.uniform(-1, 1, (3, 3000)) * [[2.5], [1.6], [math.pi]]
        readings = array.read([world.client] * 3000, x, y, np.cos(heading), np.sin(heading))
    assert ((readings >= low) & (readings <= high)).all()
    assert (readings[:, :2] < LIGHT_MAX).any(axis=0).all()


def test_a_row_does_not_depend_on_its_neighbours() -> None:
    generator = np.random.default_rng(1)
    with World(ARENA, "planar") as world:
        array = SensorArray(ARENA)
        x, y, heading = generator.uniform(-1, 1, (3, 37)) * [[1.3], [1.3], [math.pi]]
        cos, sin = np.cos(heading), np.sin(heading)
        together = array.read([world.client] * 37, x, y, cos, sin)
        alone = [array.read([world.client], *(c[i : i + 1] for c in (x, y, cos, sin)))[0] for i in range(37)]
    assert np.array_equal(together, alone)
