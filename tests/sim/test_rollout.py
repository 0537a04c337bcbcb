import dataclasses
import math
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import policies
import pytest

import sim
from sim.arena import draw_start
from sim.result import Rollout, Steps
from sim.robot import CONTROL_HZ, RADIUS, TOUCH


def equal(a: Rollout, b: Rollout) -> bool:
    """Every bit of every column, times and trajectories included."""
    columns = [(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(Rollout)]
    columns += [(getattr(a.trajectory, f.name), getattr(b.trajectory, f.name)) for f in dataclasses.fields(Steps)]
    arrays = [(x, y) for x, y in columns if isinstance(x, np.ndarray)]
    return all(x.shape == y.shape and x.dtype == y.dtype and x.tobytes() == y.tobytes() for x, y in arrays)


@pytest.fixture(scope="module")
def teacher() -> Rollout:
    return sim.rollout(sim.Teacher(), episodes=range(20), seed=4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("engine", "body", "policy"),
    [
        ("vector", "planar", sim.Teacher()),
        ("vector", "planar", policies.random),
        ("bullet", "planar", policies.random),
        ("bullet", "wheeled", sim.Teacher()),
    ],
)
def test_batch_size_and_order_change_no_bit(engine: str, body: str, policy: sim.ControllerLike) -> None:
    run: dict[str, Any] = {"engine": engine, "body": body, "seed": 4, "seconds": 6.0}
    alone = sim.rollout(policy, episodes=range(5), robots=1, **run)
    assert equal(alone, sim.rollout(policy, episodes=range(5), robots=1, **run))
    assert equal(alone, sim.rollout(policy, episodes=range(5), robots=16, **run))
    assert equal(alone, sim.rollout(policy, episodes=range(5), robots=4, **run))
    backwards = sim.rollout(policy, episodes=[4, 2, 0], robots=2, **run)
    for episode in (4, 2, 0):
        for field in dataclasses.fields(Steps):
            ours, theirs = (getattr(r.slice(episode), field.name) for r in (backwards, alone))
            assert np.array_equal(ours, theirs)
    assert not equal(alone, sim.rollout(policy, episodes=range(5), **{**run, "seed": 5}))


@pytest.mark.slow
def test_workers_change_no_bit_and_report_all_episodes(teacher: Rollout) -> None:
    finished: list[int] = []
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        run: dict[str, Any] = {"episodes": range(20), "seed": 4, "executor": pool, "workers": 2}
        assert equal(teacher, sim.rollout(sim.Teacher(), **run, progress=finished.append))
        assert equal(teacher, sim.rollout(sim.Teacher(), **run, robots=3))
        with pytest.raises(ValueError, match="episode 2, step 3"):
            sim.rollout(policies.nan_in_one, **run)
    assert sum(finished) == 20
    assert equal(teacher, sim.rollout(sim.Teacher(), episodes=range(20), seed=4, workers=2))


def test_progress_counts_every_episode_once() -> None:
    finished: list[int] = []
    sim.rollout(policies.still, episodes=range(7), robots=3, seconds=1.0, progress=finished.append)
    assert sum(finished) == 7
    assert len(finished) == 3


def test_every_controller_meets_the_same_starts() -> None:
    runs = [sim.rollout(policy, episodes=range(10), seed=7, seconds=1.0) for policy in (sim.Teacher(), policies.random)]
    expected = [dataclasses.astuple(draw_start(sim.corral(), 7, episode)) for episode in range(10)]
    for run in runs:
        assert run.start.tolist() == [list(start) for start in expected]
        assert [(path.x[0], path.y[0]) for path in map(run.slice, range(10))] == [(x, y) for x, y, _ in expected]


def test_every_controller_meets_the_same_wheel_noise() -> None:
    # Two policies that differ only after the first second move alike until then.
    class Late(policies.Counting):
        def commands(self, readings: np.ndarray, episodes: np.ndarray, steps: np.ndarray) -> np.ndarray:
            return np.where(steps[:, None] < 20, 1.0, -1.0) * np.ones((1, 2))

    a = sim.rollout(policies.forward, episodes=[3], seconds=2.0).trajectory
    b = sim.rollout(Late(), episodes=[3], seconds=2.0).trajectory
    assert np.array_equal(a.x[:21], b.x[:21])
    assert not np.array_equal(a.x[:22], b.x[:22])


def test_wheel_noise_has_the_stated_size() -> None:
    arena = sim.corral(side=9.0, wheel_noise=0.3)
    path = sim.rollout(policies.forward, arena=arena, episodes=range(40), seconds=2.0)
    speed, turn = [], []
    for episode in range(40):
        rows = path.slice(episode)
        clear = slice(0, 1 + int(np.argmax(rows.contact)) if rows.contact.any() else None)
        # The path of a step is the chord of an arc; at these turns it is the arc to 1e-4.
        speed.append(np.hypot(np.diff(rows.x[clear]), np.diff(rows.y[clear])) * CONTROL_HZ)
        turn.append((np.diff(rows.heading[clear]) + math.pi) % (2 * math.pi) - math.pi)
    # Mean of two wheels with standard deviation .3 each.
    assert np.concatenate(speed).mean() == pytest.approx(0.4, abs=0.01)
    assert np.concatenate(speed).std() == pytest.approx(0.4 * 0.3 / math.sqrt(2), rel=0.08)
    assert np.concatenate(turn).std() * CONTROL_HZ == pytest.approx(0.4 * 0.3 * math.sqrt(2) / 0.26, rel=0.08)


def test_no_noise_is_exact() -> None:
    path = sim.rollout(policies.forward, arena=sim.corral(wheel_noise=0.0), episodes=[1], seconds=0.5).trajectory
    assert np.hypot(np.diff(path.x), np.diff(path.y)) == pytest.approx(np.full(9, 0.4 / CONTROL_HZ), abs=1e-12)


def test_the_record_explains_the_figures(teacher: Rollout) -> None:
    (lamp,) = teacher.arena.lamps
    assert teacher.success.all()
    assert teacher.escaped.all()
    for row, episode in enumerate(teacher.episode.tolist()):
        path = teacher.slice(episode)
        assert path.step.tolist() == list(range(teacher.steps[row]))
        assert np.array_equal(path.commands, sim.Teacher()(path.sensors))
        gap = np.hypot(path.x - lamp.x, path.y - lamp.y) - RADIUS - lamp.radius
        assert np.array_equal(path.at_lamp, gap <= TOUCH)
        assert not path.goal.any()
        first = int(np.argmax(path.at_lamp))
        assert teacher.time_to_light[row] == first / CONTROL_HZ
        assert np.array_equal(path.reached, path.step >= first)
        assert teacher.dwell[row] == path.at_lamp[first:].mean()
        assert teacher.collisions[row] == path.contact.mean()
        # At the lamp throughout the dwell time, which ends with the episode, and never so long before.
        dwell = round(teacher.dwell_seconds * CONTROL_HZ)
        assert path.at_lamp[-dwell:].all()
        assert not path.at_lamp[-dwell - 1]
    assert np.array_equal(teacher.step_episode, np.repeat(teacher.episode, teacher.steps))


def test_contact_is_touching_a_wall() -> None:
    run = sim.rollout(policies.forward, episodes=range(8), seed=1, seconds=10.0)
    # Away from the wall with the gap, the nearest wall is one of the three others.
    path = run.trajectory.rows(run.trajectory.x < 1.2)
    gap = 1.5 - np.maximum(-path.x, np.abs(path.y)) - RADIUS
    assert np.array_equal(path.contact, gap <= TOUCH)
    assert 0.1 < path.contact.mean() < 0.9
    assert run.summary().collision_fraction == pytest.approx(run.trajectory.contact.mean())


def test_the_summary(teacher: Rollout) -> None:
    summary = teacher.summary()
    assert (summary.episodes, summary.success_rate, summary.escape_rate) == (20, 1.0, 1.0)
    assert (summary.success_low, summary.success_high) == pytest.approx(sim.wilson(20, 20))
    assert summary.time_to_light_s == pytest.approx(float(np.median(teacher.time_to_light)))
    assert summary.dwell_fraction == pytest.approx(teacher.trajectory.at_lamp[teacher.trajectory.reached].mean())


def test_the_summary_of_robots_that_never_reach_the_lamp() -> None:
    run = sim.rollout(policies.still, episodes=range(5), seconds=1.0, record=False)
    summary = run.summary()
    assert np.isnan(run.time_to_light).all()
    assert np.isnan(run.dwell).all()
    assert (summary.success_rate, summary.success_low) == (0.0, 0.0)
    assert (summary.time_to_light_s, summary.dwell_fraction, summary.escape_rate) == (None, None, 0.0)
    assert run.steps.tolist() == [CONTROL_HZ] * 5


def test_failures_are_censored_even_where_the_lamp_was_touched(teacher: Rollout) -> None:
    times = teacher.time_to_light
    most = dataclasses.replace(teacher, success=np.arange(20) < 11)
    slowest, before = sorted(times[:11])[:-3:-1]
    assert most.summary().time_to_light_s == pytest.approx((slowest + before) / 2)
    half = dataclasses.replace(teacher, success=np.arange(20) < 10)
    assert half.summary().time_to_light_s is None


def test_without_a_record_the_figures_stay(teacher: Rollout) -> None:
    bare = sim.rollout(sim.Teacher(), episodes=range(20), seed=4, record=False)
    assert len(bare.trajectory) == 0
    assert bare.trajectory.sensors.shape == (0, 3)
    assert bare.summary() == teacher.summary()
    with pytest.raises(KeyError, match="record=True"):
        bare.slice(3)
    with pytest.raises(KeyError, match="episode 99 is not in this rollout"):
        teacher.slice(99)


def test_the_dwell_time_is_needed() -> None:
    short = sim.rollout(sim.Teacher(), episodes=range(5), seed=4, dwell=0.5)
    long = sim.rollout(sim.Teacher(), episodes=range(5), seed=4, dwell=3.0)
    assert np.array_equal(short.time_to_light, long.time_to_light)
    assert (long.steps >= short.steps + 50).all()


def test_an_episode_that_times_out_on_its_way_fails() -> None:
    run = sim.rollout(sim.Teacher(), episodes=range(5), seed=4, seconds=2.5)
    assert not run.success.any()
    assert run.steps.tolist() == [50] * 5


def test_commands_beyond_full_speed_are_clipped_but_recorded_as_given() -> None:
    def excessive(sensors: np.ndarray) -> np.ndarray:
        return np.full((len(sensors), 2), 5.0)

    fast = sim.rollout(excessive, episodes=[2], seconds=2.0).trajectory
    full = sim.rollout(policies.forward, episodes=[2], seconds=2.0).trajectory
    assert np.array_equal(fast.x, full.x)
    assert (fast.commands == 5.0).all()


def test_a_policy_cannot_change_the_record() -> None:
    def vandal(sensors: np.ndarray) -> np.ndarray:
        sensors[:] = -1.0
        return np.zeros((len(sensors), 2))

    path = sim.rollout(vandal, episodes=range(3), seconds=0.5).trajectory
    assert path.sensors.min() >= 0
    assert path.step.tolist() == list(range(10)) * 3


def test_nan_names_episode_and_step() -> None:
    with pytest.raises(ValueError, match=r"episode 2, step 3: the policy commanded \[1.0, nan\]"):
        sim.rollout(policies.nan_in_one, episodes=range(5))


@pytest.mark.parametrize("answer", [lambda s: np.ones(2), lambda s: np.ones((len(s), 3)), lambda s: "left"])
def test_wrong_answers_name_episode_and_step(answer: Callable[[np.ndarray], Any]) -> None:
    with pytest.raises(ValueError, match=r"episode 4, step 0: "):
        sim.rollout(answer, episodes=[4, 5, 6])


def test_a_policy_that_breaks_leaves_no_client() -> None:
    with pytest.raises(RuntimeError, match="the policy broke"):
        sim.rollout(policies.failing, episodes=range(5))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"arena": "maze"}, "unknown arena 'maze'"),
        ({"body": "flying"}, "unknown body 'flying'"),
        ({"episodes": []}, "expected at least one whole number"),
        ({"episodes": [0.5]}, "episode 0.5; expected a whole number"),
        ({"episodes": [3, 1, 3]}, "episode 3 is given 2 times"),
        ({"episodes": [-2]}, "episode -2"),
        ({"seed": -1}, "seed -1"),
        ({"seconds": 0.0}, "0.0 s; expected"),
        ({"seconds": math.inf}, "inf s; expected"),
        ({"dwell": -1.0}, "-1.0 s; expected"),
        ({"robots": 0}, "robots 0"),
        ({"workers": 0}, "workers 0"),
    ],
)
def test_bad_input_is_named(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sim.rollout(sim.Teacher(), **change)


@pytest.mark.slow
def test_the_teacher_solves_the_default_arena_on_both_bodies_and_chance_does_not() -> None:
    planar = sim.rollout(sim.Teacher(), episodes=range(1000, 1060)).summary()
    wheeled = sim.rollout(sim.Teacher(), engine="bullet", body="wheeled", episodes=range(1000, 1030)).summary()
    chance = sim.rollout(policies.random, episodes=range(1000, 1020), record=False).summary()
    assert planar.success_rate >= 0.97
    assert abs(planar.success_rate - wheeled.success_rate) <= 0.05
    assert chance.success_rate <= 0.1
    assert planar.time_to_light_s is not None
    assert wheeled.time_to_light_s == pytest.approx(planar.time_to_light_s, rel=0.35)


@pytest.mark.slow
def test_the_teachers_episodes_show_all_of_its_rules_and_few_bins_contradict() -> None:
    run = sim.rollout(sim.Teacher(), episodes=range(60), seed=8)
    rows = run.trajectory.rows(~run.trajectory.reached)
    shares = np.bincount(sim.Teacher().rule(rows.sensors), minlength=5) / len(rows)
    assert shares.min() > 0.01
    high = np.array([sensor.high for sensor in sim.SENSORS])
    for bins in (16, 32):
        cells = np.minimum((rows.sensors / high * bins).astype(int), bins - 1) @ [bins * bins, bins, 1]
        table: dict[int, dict[tuple[float, ...], int]] = {}
        for cell, command in zip(cells.tolist(), rows.commands.tolist(), strict=True):
            seen = table.setdefault(cell, {})
            seen[tuple(command)] = seen.get(tuple(command), 0) + 1
        minority = sum(sum(seen.values()) - max(seen.values()) for seen in table.values())
        assert minority / len(rows) < 0.015
