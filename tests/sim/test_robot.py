import math

import numpy as np
import pybullet
import pytest

import sim
from sim.arena import Start
from sim.engine import Engine
from sim.engines import find_engine
from sim.engines.bodies import HEIGHT
from sim.engines.bullet import Bullet
from sim.engines.world import World
from sim.robot import CONTROL_HZ, MAX_SPEED, RADIUS, TOUCH, TRACK

ARENA = sim.corral(side=3.0, gap=1.0, lamp_beyond=0.8)
BODIES = ["planar", "wheeled"]
ENGINES = [("vector", "planar"), ("bullet", "planar"), ("bullet", "wheeled")]
SLOT = np.array([0])


def placed(engine: str, body: str, start: Start) -> Engine:
    """One robot at a start that no episode has."""
    made = find_engine(engine)(1, ARENA, sim.Task(), body)
    made.reset(SLOT, SLOT)
    made._place(SLOT, np.array([[start.x, start.y, start.heading]]))
    return made


def height(world: World) -> float:
    return pybullet.getBasePositionAndOrientation(world.body.id, world.client)[0][2]


@pytest.mark.parametrize(("body", "slack"), [("planar", 1e-9), ("wheeled", 0.04)])
def test_equal_wheels_go_straight_at_full_speed(body: str, slack: float) -> None:
    with World(ARENA, body) as world:
        x, y, cos, _ = world.body.place(Start(-1.2, 0.3, 0.0))
        for _ in range(2 * CONTROL_HZ):
            x, y, cos, _ = world.body.drive(MAX_SPEED, MAX_SPEED)
    assert x == pytest.approx(-1.2 + 2 * MAX_SPEED, abs=slack)
    assert y == pytest.approx(0.3, abs=slack / 4)
    assert cos == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(("body", "slack"), [("planar", 1e-9), ("wheeled", 0.3)])
def test_opposite_wheels_turn_on_the_spot(body: str, slack: float) -> None:
    with World(ARENA, body) as world:
        x, y, cos, sin = world.body.place(Start(0.0, 0.0, 0.2))
        turned = 0.0
        for _ in range(20):
            before = math.atan2(sin, cos)
            x, y, cos, sin = world.body.drive(-MAX_SPEED, MAX_SPEED)
            turned += (math.atan2(sin, cos) - before) % (2 * math.pi)
    assert turned == pytest.approx(2 * MAX_SPEED / TRACK, abs=slack + 1e-6)
    assert math.hypot(x, y) < max(slack / 30, 1e-9)


def test_the_planar_body_follows_the_arc_of_its_wheels() -> None:
    left, right = 0.3, 0.4
    with World(ARENA, "planar") as world:
        x, y, _, _ = world.body.place(Start(0.0, 0.0, 0.0))
        for _ in range(CONTROL_HZ):
            x, y, _, _ = world.body.drive(left, right)
    turn, radius = (right - left) / TRACK, (left + right) / 2 / ((right - left) / TRACK)
    assert x == pytest.approx(radius * math.sin(turn), abs=1e-4)
    assert y == pytest.approx(radius * (1 - math.cos(turn)), abs=1e-4)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("heading", [math.pi, math.pi / 2, -2.0, 2.4])
def test_no_robot_drives_through_a_wall(body: str, heading: float) -> None:
    with World(ARENA, body) as world:
        x, y, _, _ = world.body.place(Start(0.0, 0.0, heading))
        for _ in range(15 * CONTROL_HZ):
            x, y, _, _ = world.body.drive(MAX_SPEED, MAX_SPEED)
            assert max(abs(x), abs(y)) <= 1.5 - RADIUS + 0.003
    assert max(abs(x), abs(y)) >= 1.5 - RADIUS - TOUCH


def test_the_planar_body_never_leaves_its_plane() -> None:
    commands = np.random.default_rng(0).choice([-1.0, 1.0], (80, 2))
    with World(ARENA, "planar") as world:
        for start in (Start(1.2, 1.2, 0.7), Start(-1.1, 0.0, 3.0), Start(1.7, 0.05, 0.0)):
            world.body.place(start)
            for left, right in commands.repeat(10, axis=0).tolist():
                world.body.drive(left * MAX_SPEED * 1.9, right * MAX_SPEED * 1.9)
                assert height(world) == pytest.approx(HEIGHT, abs=1e-5)
            _, rotation = pybullet.getBasePositionAndOrientation(world.body.id, world.client)
            assert np.abs(rotation[:2]).max() < 1e-6


def test_a_minute_against_the_lamp_does_not_lift_the_planar_body() -> None:
    with placed("bullet", "planar", Start(1.9, 0.02, 0.0)) as engine:
        assert isinstance(engine, Bullet)
        teacher = sim.Teacher()
        for _ in range(60 * CONTROL_HZ):
            engine.drive(SLOT, teacher(engine.observe(SLOT).sensors))
        assert height(engine.worlds[0]) == pytest.approx(HEIGHT, abs=1e-5)


def test_the_wheeled_body_stays_on_the_floor() -> None:
    with World(ARENA, "wheeled") as world:
        world.body.place(Start(0.5, 1.0, 0.3))
        for step in range(300):
            world.body.drive(MAX_SPEED, MAX_SPEED if step // 40 % 2 else -MAX_SPEED)
            assert height(world) == pytest.approx(HEIGHT, abs=0.003)


@pytest.mark.parametrize(("engine", "body"), ENGINES)
def test_a_robot_that_faces_the_lamp_comes_to_rest_against_it_and_stays(engine: str, body: str) -> None:
    with placed(engine, body, Start(1.0, 0.1, 0.0)) as robot:
        teacher, touching = sim.Teacher(), []
        state = robot.observe(SLOT)
        for _ in range(20 * CONTROL_HZ):
            robot.drive(SLOT, teacher(state.sensors))
            state = robot.observe(SLOT)
            touching.append(bool(state.at_goals[0, 0]))
        assert math.hypot(state.x[0] - 2.3, state.y[0]) == pytest.approx(RADIUS + ARENA.lamps[0].radius, abs=TOUCH)
    first = touching.index(True)
    assert first < 5 * CONTROL_HZ
    assert np.mean(touching[first:]) > 0.95


@pytest.mark.parametrize("body", BODIES)
def test_a_placed_robot_behaves_as_a_new_one(body: str) -> None:
    def path(world: World, start: Start, steps: int) -> list[tuple[float, ...]]:
        poses = [world.body.place(start)]
        return poses + [world.body.drive(0.4, 0.3 if step // 20 % 2 else -0.1) for step in range(steps)]

    start = Start(-1.2, 1.2, 2.0)
    with World(ARENA, body) as new:
        expected = path(new, start, 200)
    with World(ARENA, body) as used:
        # It has been pressed into the very corner that the episode starts in, and is moving.
        path(used, Start(-1.25, 1.25, 2.3), 33)
        assert path(used, start, 200) == expected


def test_unknown_bodies_and_engines_are_named() -> None:
    with pytest.raises(ValueError, match=r"unknown body 'flying'.*'planar', 'wheeled'"):
        find_engine("bullet").find_body("flying")
    with pytest.raises(ValueError, match=r"unknown body 'wheeled'.*'planar'.*engine='bullet' has wheels"):
        find_engine("vector").find_body("wheeled")
    with pytest.raises(ValueError, match=r"unknown engine 'steam'.*'bullet', 'vector'"):
        find_engine("steam")


@pytest.mark.parametrize(
    ("towards", "start"),
    [
        (0.8634414776475721, Start(1.2902281012846517, -0.4235403289505195, -0.7081469337904926)),
        (2.6447351615570636, Start(0.4008430514954504, -0.5801602647117043, -1.1122976494527181)),
    ],
)
def test_a_contact_ends_when_the_robot_is_placed_elsewhere(towards: float, start: Start) -> None:
    arena = sim.find_arena("lamp_room")
    lamp = arena.lamps[1]

    def first_step(world: World) -> tuple[float, ...]:
        world.body.place(start)
        return world.body.drive(0.3, 0.3)

    with World(arena, "planar") as used, World(arena, "planar") as new:
        used.body.place(Start(lamp.x - 0.6 * math.cos(towards), lamp.y - 0.6 * math.sin(towards), towards))
        for _ in range(30):
            used.body.drive(MAX_SPEED, MAX_SPEED)
        # The robot touches the lamp, and its next start is beyond it.
        assert first_step(used) == first_step(new)
