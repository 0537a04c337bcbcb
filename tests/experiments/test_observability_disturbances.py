"""Disturbances, value by value: what they change, and that an episode is disturbed alike wherever it is driven."""

import pickle
from typing import Any

import numpy as np
import pytest

import sim
from experiments.models.disturbances import DISTURBANCES, HIGH, LOW, Stuck, disturb_in_turns


def recording(episodes: int = 6, steps: int = 80) -> tuple[Any, Any, Any]:
    rng = np.random.default_rng(1)
    readings = rng.uniform(LOW, HIGH, (episodes * steps, len(LOW)))
    return readings, np.repeat(np.arange(episodes) + 3, steps), np.tile(np.arange(steps), episodes)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_strength_0_changes_nothing_and_the_strongest_does(name: str) -> None:
    readings, episodes, _ = recording()
    np.testing.assert_array_equal(sim.replay(DISTURBANCES[name](0, 0), readings, episodes), readings)
    assert not np.array_equal(sim.replay(DISTURBANCES[name](1, 0), readings, episodes), readings)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_an_episode_is_disturbed_in_the_same_way_in_any_batch_and_any_copy(name: str) -> None:
    readings, episodes, steps = recording()
    expected = sim.replay(DISTURBANCES[name](1 if name in ("delayed", "aliased") else 0.5, 4), readings, episodes)
    disturbance = pickle.loads(pickle.dumps(DISTURBANCES[name](1 if name in ("delayed", "aliased") else 0.5, 4)))
    found = np.zeros_like(readings)
    # The episodes backwards, one at a time and all together.
    for group in (np.unique(episodes)[::-1], *np.unique(episodes)[:, None]):
        state = disturbance.start(group)
        for step in range(80):
            rows = [np.flatnonzero((steps == step) & (episodes == episode))[0] for episode in group]
            found[rows], state = disturbance.step(readings[rows], state)
        own = np.isin(episodes, group)
        np.testing.assert_array_equal(found[own], expected[own])


def test_the_share_of_missing_readings_is_the_one_asked_for_and_all_else_arrives() -> None:
    readings, episodes, _ = recording(40, 300)
    seen = sim.replay(DISTURBANCES["missing"](0.3, 0), readings, episodes)
    lost = np.isnan(seen)
    # Four standard deviations of the share of 36,000 independent losses.
    assert abs(lost.mean() - 0.3) < 4 * (0.3 * 0.7 / lost.size) ** 0.5
    np.testing.assert_array_equal(seen[~lost], readings[~lost])
    stronger = np.isnan(sim.replay(DISTURBANCES["missing"](0.6, 0), readings, episodes))
    assert (stronger | ~lost).all()


@pytest.mark.parametrize("delay", [1, 5])
def test_a_delayed_reading_is_the_one_some_steps_before(delay: int) -> None:
    readings, episodes, steps = recording()
    seen = sim.replay(DISTURBANCES["delayed"](delay, 0), readings, episodes)
    rows = np.arange(len(readings))
    np.testing.assert_array_equal(seen, readings[rows - np.minimum(steps, delay)])


def test_a_stuck_sensor_repeats_one_reading_from_its_onset_on() -> None:
    readings, episodes, _ = recording(5, 300)
    disturbance = DISTURBANCES["stuck"](0.5, 2)
    assert isinstance(disturbance, Stuck)
    seen = sim.replay(disturbance, readings, episodes)
    onsets = np.array([disturbance.onset(episode) for episode in np.unique(episodes)])
    assert np.isfinite(onsets).any()
    assert np.isinf(onsets).any()
    for episode, own in enumerate(onsets):
        rows = slice(300 * episode, 300 * (episode + 1))
        for sensor, onset in enumerate(own):
            source = np.minimum(np.arange(300), onset).astype(int)
            np.testing.assert_array_equal(seen[rows, sensor], readings[rows, sensor][source])


def test_noise_has_the_asked_spread_and_stays_in_range() -> None:
    _, episodes, steps = recording(30, 200)
    readings = np.tile((LOW + HIGH) / 2, (len(steps), 1))
    seen = sim.replay(DISTURBANCES["noisy"](0.05, 0), readings, episodes)
    np.testing.assert_allclose((seen - readings).std(0), 0.05 * (HIGH - LOW), rtol=0.05)
    rough = sim.replay(DISTURBANCES["noisy"](1, 0), readings, episodes)
    assert (rough >= LOW).all()
    assert (rough <= HIGH).all()


def test_disturbances_take_turns_by_episode() -> None:
    readings, episodes, _ = recording(4)
    seen = disturb_in_turns([DISTURBANCES["aliased"](0, 0), DISTURBANCES["aliased"](4, 0)], readings, episodes)
    gone = np.isnan(seen)
    assert not gone[(episodes == 3) | (episodes == 5)].any()
    assert gone[(episodes == 4) | (episodes == 6)][:, :2].all()
    assert not gone[:, 2].any()
