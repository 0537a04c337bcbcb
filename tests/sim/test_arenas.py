import dataclasses
import math
from typing import Any

import numpy as np
import pytest

import sim
from sim.arena import draw_episodes
from sim.robot import RADIUS
from sim.shapes import Shapes


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"side": -1.0}, r"Box\.half_x is -0\.5"),
        ({"side": math.nan}, r"Box\.half_x is nan"),
        ({"gap": 3.0}, "gap .*must leave a piece of wall"),
        ({"gap": 0.3}, "gap is 0.3 m wide; it must be wider than the robot"),
        ({"gap_offset": 1.1}, "gap .*must leave a piece of wall"),
        ({"lamp_beyond": 0.2, "lamp_offset": 0.6}, r"Arena\.lamps holds Lamp"),
        ({"start_margin": 0.1}, r"Arena\.start_margin is 0\.1"),
        ({"start_margin": 1.5}, r"Arena\.start_margin is 1\.5"),
        ({"wheel_noise": -0.1}, r"Arena\.wheel_noise is -0\.1"),
        ({"wheel_noise": "much"}, r"Arena\.wheel_noise is 'much'; expected a finite number"),
        ({"lamp_radius": 0}, r"Lamp\.radius is 0"),
    ],
)
def test_an_arena_that_cannot_be_built_names_what_is_wrong(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sim.corral(**change)


def test_an_arena_needs_a_lamp() -> None:
    with pytest.raises(ValueError, match=r"Arena\.lamps is empty"):
        dataclasses.replace(sim.corral(), lamps=())


def inside_a_wall(arena: sim.Arena, x: float, y: float) -> bool:
    return any(box.holds(np.array(x), np.array(y)) for box in arena.obstacles if isinstance(box, sim.Box))


def test_walls_enclose_the_corral_but_for_the_gap() -> None:
    arena = sim.corral(side=3.0, gap=0.8, gap_offset=0.3)
    along = np.linspace(-1.55, 1.55, 400)
    assert all(inside_a_wall(arena, -1.53, y) for y in along)
    assert all(inside_a_wall(arena, x, 1.53) and inside_a_wall(arena, x, -1.53) for x in along)
    open_at = [y for y in along if not inside_a_wall(arena, 1.53, y)]
    assert min(open_at) == pytest.approx(0.3 - 0.4, abs=0.01)
    assert max(open_at) == pytest.approx(0.3 + 0.4, abs=0.01)
    assert not any(inside_a_wall(arena, x, y) for x in (-1.49, 0.0, 1.49) for y in (-1.49, 0.0, 1.49))


def test_the_wall_of_two_gaps_has_two() -> None:
    arena = sim.find_arena("two_gaps")
    open_at = [y for y in np.linspace(-1.5, 1.5, 601) if not inside_a_wall(arena, 1.53, y)]
    assert len(open_at) == pytest.approx(2 * 0.7 * 200, abs=4)
    assert 0.0 not in open_at


def test_the_lamp_stands_beyond_the_middle_of_the_gap() -> None:
    (lamp,) = sim.corral(side=3.0, lamp_beyond=0.8, gap_offset=0.2, lamp_offset=0.3).lamps
    assert (lamp.x, lamp.y) == pytest.approx((2.3, 0.5))


@pytest.mark.parametrize("layout", range(8))
def test_robots_fit_between_the_obstacles_of_clutter(layout: int) -> None:
    arena = sim.ARENAS["clutter"](layout=layout)
    within = [shape for shape in arena.obstacles if shape not in sim.corral().obstacles]
    assert 4 <= len(within) <= 6
    assert {type(shape) for shape in within} == {sim.Box, sim.Pillar}
    assert arena == sim.ARENAS["clutter"](layout=layout) != sim.ARENAS["clutter"](layout=layout + 1)
    for shape in within:
        half = shape.half_x if isinstance(shape, sim.Box) else shape.radius
        others = Shapes([other for other in arena.obstacles if other is not shape])
        around = np.linspace(-math.pi, math.pi, 100)
        x, y = shape.x + half * np.cos(around), shape.y + half * np.sin(around)
        assert others.distance(x, y).min() > 2 * RADIUS


def test_arenas_are_found_by_name_and_the_error_lists_them() -> None:
    assert sim.find_arena("default") == sim.corral()
    assert len({sim.find_arena(name) for name in sim.ARENAS}) == len(sim.ARENAS) >= 7
    with pytest.raises(ValueError, match=r"unknown arena 'maze'.*'default'.*'narrow'"):
        sim.find_arena("maze")


def test_an_arena_is_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        sim.corral().wheel_noise = 0.0  # pyright: ignore[reportAttributeAccessIssue]


def test_starts_fill_the_corral_and_keep_the_margin() -> None:
    arena = sim.corral(side=3.0, start_margin=0.4)
    starts = np.array([dataclasses.astuple(sim.draw_start(arena, 0, episode)) for episode in range(2000)])
    assert np.abs(starts[:, :2]).max() <= 1.1
    # Uniform: mean 0, standard deviation range / sqrt(12); four standard errors.
    for column, width in zip(starts.T, (2.2, 2.2, 2 * math.pi), strict=True):
        assert abs(column.mean()) < 4 * width / math.sqrt(12 * 2000)
        assert column.std() == pytest.approx(width / math.sqrt(12), rel=0.05)


def test_an_episode_depends_on_seed_and_number_alone() -> None:
    arena = sim.find_arena("clutter")
    starts, (generator, _) = draw_episodes(arena, 3, [7, 8])
    again, (twin,) = draw_episodes(arena, 3, [7])
    assert starts[0].tolist() == again[0].tolist() == list(dataclasses.astuple(sim.draw_start(arena, 3, 7)))
    assert np.array_equal(generator.standard_normal(100), twin.standard_normal(100))
    others = {sim.draw_start(arena, seed, episode) for seed in range(20) for episode in range(20)}
    assert len(others) == 400


def test_no_robot_starts_in_an_obstacle() -> None:
    arena = sim.find_arena("clutter")
    starts, _ = draw_episodes(arena, 0, range(500))
    assert Shapes(arena.obstacles).distance(*starts[:, :2].T).min() >= arena.start_margin - 1e-9
    full = dataclasses.replace(arena, obstacles=(sim.Box(0.0, 0.0, 1.4, 1.4),))
    with pytest.raises(ValueError, match="no place to start"):
        draw_episodes(full, 0, [0])


@pytest.mark.parametrize(("seed", "episode"), [(-1, 0), (0, -1)])
def test_negative_seeds_and_episodes_are_refused(seed: int, episode: int) -> None:
    with pytest.raises(ValueError, match=r"(seed|episode) -1; expected a whole number, 0 or more"):
        sim.draw_start(sim.corral(), seed, episode)
