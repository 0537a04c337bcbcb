import dataclasses
import math

import numpy as np
import pytest

import sim
from sim.corral import draw_episode, find_arena
from sim.vector_sim import VectorSim


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"side": -1.0}, "side"),
        ({"side": math.nan}, "side"),
        ({"gap": "wide"}, "gap"),
        ({"gap": 3.0}, "gap"),
        ({"gap_offset": 1.1}, "gap"),
        ({"lamp_beyond": 0.2}, "lamp_beyond"),
        ({"start_margin": 0.1}, "start_margin"),
        ({"start_margin": 1.5}, "start_margin"),
        ({"wheel_noise": -0.1}, "wheel_noise"),
    ],
)
def test_an_arena_that_cannot_be_built_names_its_field(change: dict[str, float], field: str) -> None:
    with pytest.raises(ValueError, match=rf"Arena\.{field} is"):
        sim.Arena(**change)


@pytest.mark.parametrize(
    ("change", "field"),
    [({"gap": 0.3}, "gap"), ({"lamp_height": 0.2}, "lamp_height"), ({"wall_height": 0.12}, "wall_height")],
)
def test_an_arena_that_does_not_fit_the_robot_is_refused(change: dict[str, float], field: str) -> None:
    with pytest.raises(ValueError, match=field):
        VectorSim(1, sim.Arena(**change))


def test_walls_enclose_the_corral_but_for_the_gap() -> None:
    arena = sim.Arena(side=3.0, gap=0.8, gap_offset=0.3, wall_thickness=0.1)

    def inside_a_wall(x: float, y: float) -> bool:
        cx, cy, hx, hy = arena.walls.T
        return bool(((np.abs(x - cx) <= hx) & (np.abs(y - cy) <= hy)).any())

    along = np.linspace(-1.59, 1.59, 400)
    assert all(inside_a_wall(-1.55, y) for y in along)
    assert all(inside_a_wall(x, 1.55) and inside_a_wall(x, -1.55) for x in along)
    open_at = [y for y in along if not inside_a_wall(1.55, y)]
    assert min(open_at) == pytest.approx(0.3 - 0.4, abs=0.01)
    assert max(open_at) == pytest.approx(0.3 + 0.4, abs=0.01)
    assert not any(inside_a_wall(x, y) for x in (-1.49, 0.0, 1.49) for y in (-1.49, 0.0, 1.49))


def test_the_lamp_stands_beyond_the_middle_of_the_gap() -> None:
    assert sim.Arena(side=3.0, lamp_beyond=0.8, gap_offset=0.2, lamp_offset=0.3).lamp == pytest.approx((2.3, 0.5))


def test_arenas_are_found_by_name_and_the_error_lists_them() -> None:
    assert find_arena("default") == sim.Arena()
    assert len(set(sim.ARENAS.values())) == len(sim.ARENAS) >= 3
    with pytest.raises(ValueError, match=r"unknown arena 'maze'.*'default'.*'narrow'"):
        find_arena("maze")


def test_an_arena_is_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        sim.Arena().side = 4.0  # pyright: ignore[reportAttributeAccessIssue]


def test_starts_fill_the_corral_and_keep_the_margin() -> None:
    arena = sim.Arena(side=3.0, start_margin=0.4)
    starts = np.array([dataclasses.astuple(sim.draw_start(arena, 0, episode)) for episode in range(2000)])
    assert np.abs(starts[:, :2]).max() <= 1.1
    # Uniform: mean 0, standard deviation range / sqrt(12); four standard errors.
    for column, width in zip(starts.T, (2.2, 2.2, 2 * math.pi), strict=True):
        assert abs(column.mean()) < 4 * width / math.sqrt(12 * 2000)
        assert column.std() == pytest.approx(width / math.sqrt(12), rel=0.05)


def test_an_episode_depends_on_seed_and_number_alone() -> None:
    arena = sim.Arena()
    start, generator = draw_episode(arena, 3, 7)
    again, twin = draw_episode(arena, 3, 7)
    assert start == again == sim.draw_start(arena, 3, 7)
    assert np.array_equal(generator.standard_normal(100), twin.standard_normal(100))
    others = {sim.draw_start(arena, seed, episode) for seed in range(20) for episode in range(20)}
    assert len(others) == 400


@pytest.mark.parametrize(("seed", "episode"), [(-1, 0), (0, -1)])
def test_negative_seeds_and_episodes_are_refused(seed: int, episode: int) -> None:
    with pytest.raises(ValueError, match=r"(seed|episode) -1; expected a whole number, 0 or more"):
        sim.draw_start(sim.Arena(), seed, episode)
