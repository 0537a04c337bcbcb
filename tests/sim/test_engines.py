import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sim
from sim.engines import find_engine
from sim.engines.vector import rotation
from sim.robot import CONTROL_HZ, MAX_SPEED, RADIUS, TRACK
from sim.shapes import Shapes

SLOT = np.array([0])


@pytest.mark.parametrize("arena", list(sim.ARENAS))
def test_paths_are_those_of_bullet_until_the_robot_touches_something(arena: str) -> None:
    where = sim.find_arena(arena)
    teacher = sim.InOrder(sim.Task.of(where))
    runs = [sim.rollout(teacher, arena, engine=engine, episodes=range(6), seconds=20.0) for engine in sim.ENGINES]
    moved = 0
    for episode in range(6):
        one, other = (run.slice(episode) for run in runs)
        steps = min(len(one), len(other))
        touches = where.touched(one.x[:steps], one.y[:steps]) | where.touched(other.x[:steps], other.y[:steps])
        free = slice(int(np.argmax(touches)) if touches.any() else steps)
        moved += len(one.x[free])
        for column in ("x", "y", "sensors"):
            np.testing.assert_allclose(getattr(one, column)[free], getattr(other, column)[free], atol=1e-9)
    assert moved > 200


def test_success_and_times_are_those_of_bullet() -> None:
    one, other = (sim.rollout(sim.Teacher(), engine=engine, episodes=range(40)) for engine in sim.ENGINES)
    assert np.array_equal(one.success, other.success)
    assert one.time_to_light.mean() == pytest.approx(other.time_to_light.mean(), rel=0.03)
    assert one.summary().collision_fraction == pytest.approx(other.summary().collision_fraction, abs=0.003)


@settings(deadline=None, max_examples=30)
@given(
    seed=st.integers(0, 2**20),
    x=st.floats(-1.2, 1.2),
    y=st.floats(-1.2, 1.2),
    heading=st.floats(-math.pi, math.pi),
    arena=st.sampled_from(["default", "two_gaps", "two_lamps"]),
)
def test_no_robot_enters_what_it_touches(seed: int, x: float, y: float, heading: float, arena: str) -> None:
    where, generator = sim.find_arena(arena), np.random.default_rng(seed)
    solids = Shapes([*where.obstacles, *where.lamps])
    with find_engine("vector")(1, where, sim.Task.of(where)) as engine:
        engine.reset(SLOT, SLOT)
        if solids.distance(np.array([x]), np.array([y]))[0] < RADIUS:
            return
        engine._place(SLOT, np.array([[x, y, heading]]))
        for _ in range(12):
            command = generator.choice([-1.0, 1.0, 0.3], (1, 2))
            for _ in range(15):
                engine.drive(SLOT, command)
            state = engine.observe(SLOT)
            assert solids.distance(state.x, state.y)[0] > RADIUS - 0.004


def test_a_robot_in_a_corner_stays_there() -> None:
    with find_engine("vector")(1, sim.corral(wheel_noise=0.0), sim.Task()) as engine:
        engine.reset(SLOT, SLOT)
        engine._place(SLOT, np.array([[-1.2, 1.2, 2.4]]))
        for _ in range(40):
            engine.drive(SLOT, np.ones((1, 2)))
        state = engine.observe(SLOT)
    assert (state.x[0], state.y[0]) == pytest.approx((-1.5 + RADIUS, 1.5 - RADIUS), abs=1e-6)
    assert state.contact[0]


def test_a_free_robot_follows_the_arc_of_its_wheels() -> None:
    with find_engine("vector")(1, sim.corral(wheel_noise=0.0), sim.Task()) as engine:
        engine.reset(SLOT, SLOT)
        engine._place(SLOT, np.zeros((1, 3)))
        for _ in range(CONTROL_HZ):
            engine.drive(SLOT, np.array([[0.5, 1.0]]))
        state = engine.observe(SLOT)
    turn = 0.5 * MAX_SPEED / TRACK
    radius = 0.75 * MAX_SPEED / turn
    assert state.heading[0] == pytest.approx(turn, abs=1e-12)
    assert (state.x[0], state.y[0]) == pytest.approx((radius * math.sin(turn), radius * (1 - math.cos(turn))), abs=1e-4)


def test_headings_stay_on_the_circle() -> None:
    with find_engine("vector")(1, sim.corral(wheel_noise=0.0), sim.Task()) as engine:
        engine.reset(SLOT, SLOT)
        engine._place(SLOT, np.array([[0.0, 0.0, 3.1]]))
        for steps in range(1, 61):
            engine.drive(SLOT, np.array([[-1.0, 1.0]]))
            heading = engine.observe(SLOT).heading[0]
            assert -math.pi < heading <= math.pi
            expected = 3.1 + steps * 2 * MAX_SPEED / TRACK / CONTROL_HZ
            assert math.cos(heading - expected) == pytest.approx(1.0, abs=1e-12)


@given(st.floats(-0.6, 0.6))
def test_rotations_are_sines_and_cosines(angle: float) -> None:
    cos, sin = rotation(np.array([angle]))
    assert cos[0] == pytest.approx(math.cos(angle), abs=3e-16)
    assert sin[0] == pytest.approx(math.sin(angle), abs=3e-16)


def test_a_robot_keeps_its_bits_at_any_place_of_any_batch() -> None:
    whole = sim.rollout(sim.Teacher(), episodes=range(300), seconds=8.0)
    for episodes, robots in ((range(132, 99, -1), 7), (range(100, 133), 1000)):
        part = sim.rollout(sim.Teacher(), episodes=episodes, seconds=8.0, robots=robots)
        for episode in (100, 117, 131):
            one, other = whole.slice(episode), part.slice(episode)
            assert one.x.tobytes() == other.x.tobytes()
            assert one.sensors.tobytes() == other.sensors.tobytes()


def test_the_vector_engine_works_without_pybullet() -> None:
    code = (
        "import sys\n"
        "class Missing:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'pybullet':\n"
        "            raise ImportError(name)\n"
        "sys.meta_path.insert(0, Missing())\n"
        "import sim\n"
        "assert sim.rollout(sim.Teacher(), episodes=range(3), seconds=2.0).recorded\n"
        "try:\n    sim.rollout(sim.Teacher(), engine='bullet')\n"
        "except ImportError as error:\n    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "pip install 'torchvsa[sim]'" in done.stdout
