import math

import numpy as np
import pybullet
import pytest

import sim
from sim.arena import Start
from sim.engines import find_engine
from sim.engines.bodies import WALL_GROUP
from sim.engines.world import SENSOR_HEIGHT, World
from sim.robot import RADIUS
from sim.sensors import DISTANCE_MAX, LIGHT_INWARD, LIGHT_MAX, LIGHT_MOUNT, LIGHT_OUTWARD, LIGHT_REACH
from sim.shapes import Shapes

ARENA = sim.corral(side=3.0, gap=1.0, lamp_beyond=0.8)
LAMP = (2.3, 0.0)
ENGINES = [("vector", "planar"), ("bullet", "planar"), ("bullet", "wheeled")]


def read_all(poses: np.ndarray, arena: sim.Arena = ARENA, engine: str = "vector", body: str = "planar") -> np.ndarray:
    """The readings of robots at poses `[B, 3]`."""
    slots = np.arange(len(poses))
    with find_engine(engine)(len(poses), arena, sim.Task(), body) as made:
        made.reset(slots, slots)
        made._place(slots, poses)
        return made.observe(slots).sensors


def read(
    x: float, y: float, heading: float, arena: sim.Arena = ARENA, engine: str = "vector", body: str = "planar"
) -> list[float]:
    return read_all(np.array([[x, y, heading]]), arena, engine, body)[0].tolist()


def to_lamp(x: float, y: float, heading: float, side: float) -> float:
    """Distance from the left (+1) or right (-1) sensor to the lamp's surface, from the definition."""
    mount = heading + side * LIGHT_MOUNT
    at = x + RADIUS * math.cos(mount), y + RADIUS * math.sin(mount)
    return math.dist(at, LAMP) - ARENA.lamps[0].radius


@pytest.mark.parametrize(("engine", "body"), ENGINES)
@pytest.mark.parametrize(("x", "y", "heading"), [(0.0, 0.0, 0.0), (-1.0, 0.1, 0.1), (1.2, -0.2, 0.3), (2.0, 0.02, 0.1)])
def test_both_lights_read_the_distance_to_the_lamp_that_the_robot_faces(
    x: float, y: float, heading: float, engine: str, body: str
) -> None:
    left, right, _ = read(x, y, heading, engine=engine, body=body)
    assert left == pytest.approx(to_lamp(x, y, heading, 1), abs=1e-6)
    assert right == pytest.approx(to_lamp(x, y, heading, -1), abs=1e-6)


def test_a_wall_hides_the_lamp() -> None:
    heading = math.atan2(0.0 - 1.2, 2.3 - 0.9)
    assert read(0.9, 1.2, heading)[:2] == [LIGHT_MAX, LIGHT_MAX]
    wide = sim.corral(side=3.0, gap=2.9, lamp_beyond=0.8)
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
    far = sim.corral(side=8.0, gap=7.0)  # The lamp is at x = 4.8.
    near_x = 4.8 - 0.15 - LIGHT_REACH + 0.05
    assert max(read(near_x, 0.0, 0.0, far)[:2]) < LIGHT_REACH
    assert read(near_x - 0.2, 0.0, 0.0, far)[:2] == [LIGHT_MAX, LIGHT_MAX]
    assert LIGHT_MAX - LIGHT_REACH >= LIGHT_MAX / 16


@pytest.mark.parametrize(("engine", "body"), ENGINES)
def test_distance_is_measured_from_the_rim_to_the_wall(engine: str, body: str) -> None:
    assert read(1.5 - RADIUS - 0.3, 1.0, 0.0, engine=engine, body=body)[2] == pytest.approx(0.3, abs=1e-5)
    assert read(-0.2, 1.5 - RADIUS - 0.12, math.pi / 2, engine=engine, body=body)[2] == pytest.approx(0.12, abs=1e-5)


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


GRAZE = 0.01
"""pybullet counts a ray that passes a convex shape within this distance as a hit, m."""


def larger(shape: sim.Box | sim.Pillar, by: float) -> sim.Box | sim.Pillar:
    if isinstance(shape, sim.Box):
        return sim.Box(shape.x, shape.y, shape.half_x + by, shape.half_y + by)
    return sim.Pillar(shape.x, shape.y, shape.radius + by)


def test_rays_meet_what_the_rays_of_pybullet_meet() -> None:
    arena = sim.find_arena("clutter")
    generator = np.random.default_rng(0)
    x, y, to_x, to_y = generator.uniform(-1.45, 1.45, (4, 3000))
    outside = Shapes(arena.obstacles).distance(x, y) > 2 * GRAZE
    x, y, to_x, to_y = (column[outside] for column in (x, y, to_x, to_y))
    with World(arena, "planar") as world:
        world.body.place(Start(9.0, 9.0, 0.0))
        ends = [np.stack([*ends, np.full(len(x), SENSOR_HEIGHT)], axis=1).tolist() for ends in ((x, y), (to_x, to_y))]
        hits = []
        for first in range(0, len(x), 1000):
            hits += pybullet.rayTestBatch(
                *(rays[first : first + 1000] for rays in ends), collisionFilterMask=WALL_GROUP,
                physicsClientId=world.client,
            )  # fmt: skip
    theirs = np.array([hit[2] if hit[0] >= 0 else 1.0 for hit in hits])

    def grown(by: float) -> np.ndarray:
        return Shapes([larger(shape, by) for shape in arena.obstacles]).first_hit(x, y, to_x, to_y)

    assert (theirs < 1).mean() > 0.2
    assert (np.abs(grown(0.0) - theirs) < 1e-3).mean() > 0.98
    assert (grown(GRAZE) <= theirs + 1e-6).all()
    assert (theirs <= grown(-GRAZE) + 1e-6).all()


def test_readings_stay_in_their_declared_range() -> None:
    generator = np.random.default_rng(0)
    low, high = np.array([(sensor.low, sensor.high) for sensor in sim.SENSORS]).T
    readings = read_all((generator.uniform(-1, 1, (3, 3000)) * [[2.5], [1.6], [math.pi]]).T)
    assert ((readings >= low) & (readings <= high)).all()
    assert (readings[:, :2] < LIGHT_MAX).any(axis=0).all()


def test_a_row_does_not_depend_on_its_neighbours() -> None:
    poses = (np.random.default_rng(1).uniform(-1, 1, (3, 37)) * [[1.3], [1.3], [math.pi]]).T
    alone = [read_all(poses[row : row + 1])[0] for row in range(37)]
    assert np.array_equal(read_all(poses), alone)


def test_each_colour_of_light_has_a_pair_of_its_own() -> None:
    floor = sim.Box(0.0, 0.0, 1.5, 1.5)
    lamps = sim.Lamp(1.0, 0.0, colour="blue"), sim.Lamp(-1.0, 0.0, colour="yellow"), sim.Lamp(1.2, 0.6, colour="blue")
    arena = sim.Arena((), lamps, floor, floor)
    slot = np.array([0])
    task = sim.Task(("blue", "yellow"), ("yellow",))
    with find_engine("vector")(1, arena, task) as engine:
        engine.reset(slot, slot)
        engine._place(slot, np.array([[0.0, 0.0, 0.0]]))
        readings = dict(zip((sensor.name for sensor in task.sensors), engine.observe(slot).sensors[0], strict=True))
    eye = RADIUS * math.cos(LIGHT_MOUNT), RADIUS * math.sin(LIGHT_MOUNT)
    assert readings["blue_left"] == readings["blue_right"] == pytest.approx(math.dist(eye, (1.0, 0.0)) - 0.15)
    assert readings["yellow_left"] == readings["yellow_right"] == LIGHT_MAX
    assert readings["distance"] == DISTANCE_MAX
