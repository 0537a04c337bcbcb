"""What a robot senses, its goals, and the teachers that know them."""

import numpy as np
import pytest

import sim
from sim.robot import RADIUS, TOUCH
from sim.sensors import LIGHT_MAX

TWO = sim.Task.of(sim.find_arena("two_lamps"))


def test_a_task_names_its_sensors() -> None:
    assert [sensor.name for sensor in sim.Task().sensors] == ["light_left", "light_right", "distance"]
    assert [sensor.name for sensor in TWO.sensors] == [
        "blue_left", "blue_right", "yellow_left", "yellow_right", "distance",
    ]  # fmt: skip
    assert TWO.pair("yellow") == (2, 3)
    assert TWO.goals == ("blue", "yellow")


def test_tasks_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match="green light is not sensed; choose from blue, yellow"):
        TWO.pair("green")
    with pytest.raises(ValueError, match="at least one goal"):
        sim.Task(goals=())
    with pytest.raises(ValueError, match="the arena has no blue lamp; choose goals from yellow"):
        sim.rollout(sim.Teacher(task=TWO), task=TWO)


def test_goals_count_in_their_order() -> None:
    run = sim.rollout(sim.InOrder(TWO), "two_lamps", episodes=range(20), seconds=90.0)
    assert run.success.mean() > 0.8
    blue, yellow = run.arena.lamps
    for episode in run.episode[run.success].tolist():
        path = run.slice(episode)
        goal = np.searchsorted(path.goal, 1)
        assert 0 < goal < len(path)
        assert (np.diff(path.goal) >= 0).all()
        for lamp, step in ((blue, goal), (yellow, int(np.argmax(path.reached)))):
            assert np.hypot(path.x[step] - lamp.x, path.y[step] - lamp.y) - lamp.radius - RADIUS <= TOUCH
        assert run.time_to_light[run.episode == episode] == np.argmax(path.reached) / sim.CONTROL_HZ > goal / 20
    only_yellow = sim.rollout(sim.Teacher(task=TWO, light="yellow"), "two_lamps", episodes=range(40))
    assert only_yellow.success.mean() < 0.4  # by chance


def test_a_teacher_goes_to_either_lamp() -> None:
    for light in TWO.lights:
        task = sim.Task(TWO.lights, (light,))
        run = sim.rollout(sim.Teacher(task=task, light=light), "two_lamps", episodes=range(40), task=task)
        assert run.success.mean() > 0.8


def test_fleeing_robots_keep_away_from_light() -> None:
    where = sim.find_arena("two_lamps")
    task = sim.Task(("blue",), ("blue",))
    to, away = (sim.rollout(teacher, where, task=task, episodes=range(30)).trajectory
                for teacher in (sim.Teacher(task=task), sim.FleeLight(task)))  # fmt: skip
    lit = [(path.sensors[:, :2] < LIGHT_MAX).all(1).mean() for path in (to, away)]
    assert lit[1] < 0.1 < lit[0]
    assert away.at_lamp.mean() < 0.01


def test_wall_following_robots_stay_near_the_wall_and_go_round() -> None:
    run = sim.rollout(sim.WallFollowing(), sim.corral(gap=0.35, wheel_noise=0.1), episodes=range(20))
    for episode in range(20):
        path = run.slice(episode)
        late = path.step > 300
        outside = np.maximum(np.abs(path.x), np.abs(path.y)) > 1.5
        if outside.any():
            continue
        assert np.median((1.5 - np.maximum(np.abs(path.x), np.abs(path.y)))[late]) < 0.6
        angle = np.unwrap(np.arctan2(path.y, path.x))
        assert abs(angle[-1] - angle[300]) > np.pi
    assert run.collisions.mean() < 0.3


@pytest.mark.parametrize("teacher", [sim.FleeLight(), sim.WallFollowing()])
def test_teachers_answer_each_row_alone(teacher: sim.ControllerLike) -> None:
    assert callable(teacher)
    readings = np.random.default_rng(0).uniform(0, [5, 5, 0.6], (50, 3))
    readings[::3, 0], readings[::4, 1] = LIGHT_MAX, LIGHT_MAX
    together = teacher(readings)
    assert set(np.unique(together)) <= {-1.0, 0.85, 1.0}
    assert np.array_equal(together, np.concatenate([teacher(row[None]) for row in readings]))
