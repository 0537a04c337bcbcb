"""Clients that nobody closed, environments that are closed, and odd seeds, episodes and actions."""

import gc
import math
from typing import Any

import gymnasium
import numpy as np
import pybullet
import pytest
from clients import connected

import sim
from sim.engines.bullet import Bullet
from sim.engines.world import World


def test_dropped_environments_free_their_clients() -> None:
    before = connected()
    for number in range(2):
        env = gymnasium.make("CorralEscape-v0", engine="bullet")
        env.reset(seed=number)
        env.step(np.ones(2))
        del env
        gc.collect()
        assert connected() == before
    vector = sim.CorralEscapeVectorEnv(3, engine="bullet")
    vector.reset(seed=0)
    assert len(connected()) == len(before) + 3
    del vector
    gc.collect()
    assert connected() == before


def test_a_dropped_fleet_frees_only_its_own_clients() -> None:
    with World(sim.corral(), "planar") as kept:
        simulator: Bullet | None = Bullet(2, sim.corral(), sim.Task())
        clients = [world.client for world in simulator.worlds] if simulator else []
        simulator = None
        gc.collect()
        assert not any(pybullet.getConnectionInfo(client)["isConnected"] for client in clients)
        assert pybullet.getConnectionInfo(kept.client)["isConnected"]


@pytest.mark.parametrize("fails", ["engines.world.build", "engine.WheelNoise", "engine.Shapes"])
def test_a_constructor_that_fails_leaves_no_client(fails: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("broken")

    before = connected()
    monkeypatch.setattr(f"sim.{fails}", broken)
    arena, task = sim.corral(), sim.Task()
    for make in (
        lambda: sim.CorralEscapeEnv(engine="bullet"),
        lambda: sim.CorralEscapeVectorEnv(3, engine="bullet"),
        lambda: Bullet(2, arena, task),
    ):
        with pytest.raises(RuntimeError, match="broken"):
            make()
        assert connected() == before


def test_a_rollout_that_fails_while_it_starts_leaves_no_client(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise MemoryError

    before = connected()
    monkeypatch.setattr("sim.engine.draw_episodes", broken)
    with pytest.raises(MemoryError):
        sim.rollout(sim.Teacher(), episodes=[0, 1], engine="bullet")
    assert connected() == before


def test_closed_environments_say_so() -> None:
    env = sim.CorralEscapeEnv(render_mode="rgb_array", engine="bullet")
    env.reset(seed=0)
    env.close()
    vector = sim.CorralEscapeVectorEnv(2, render_mode="rgb_array", engine="bullet")
    vector.reset(seed=0)
    vector.close()
    for use in (
        lambda: env.step(np.zeros(2)),
        env.reset,
        env.render,
        lambda: vector.step(np.zeros((2, 2))),
        vector.reset,
        vector.render,
    ):
        with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="the environment is closed"):
            use()
    env.close()
    vector.close()


ODD: list[Any] = [-1, 1.5, 1.0, True, np.bool_(True), 2**63, 2**70, "3", math.nan, 1j, [1]]


@pytest.mark.parametrize("odd", ODD)
def test_odd_seeds_and_episodes_are_refused(odd: Any) -> None:
    env = sim.CorralEscapeEnv()
    vector = sim.CorralEscapeVectorEnv(2)
    env.reset(seed=3)
    first = env.step(np.ones(2))[0]
    pose = env.reset(seed=3)[1]["pose"]
    for reset in (
        lambda: env.reset(seed=odd),
        lambda: vector.reset(seed=odd),
        lambda: sim.rollout(sim.Teacher(), seed=odd, episodes=[0]),
        lambda: sim.draw_start(sim.corral(), odd, 0),
    ):
        with pytest.raises(ValueError, match=r"seed .*; expected a whole number, 0 or more"):
            reset()
    for reset in (
        lambda: env.reset(seed=5, options={"episode": odd}),
        lambda: sim.rollout(sim.Teacher(), episodes=[0, odd]),
        lambda: sim.draw_start(sim.corral(), 0, odd),
    ):
        with pytest.raises(ValueError, match=r"episode .*; expected a whole number, 0 or more"):
            reset()
    # What was refused changed nothing: the episode goes on, and the next one is that of the old seed.
    assert np.array_equal(env.step(np.ones(2))[0], first)
    following = env.reset()[1]
    assert following["episode"] == 1
    assert following["pose"].tolist() != pose.tolist()
    start = sim.draw_start(sim.corral(), 3, 1)
    assert following["pose"][:2].tolist() == [start.x, start.y]
    env.close()
    vector.close()


def test_whole_numbers_of_numpy_are_seeds() -> None:
    env = sim.CorralEscapeEnv()
    one = env.reset(seed=int(np.int64(3)), options={"episode": 2})[1]["pose"]
    two = env.reset(seed=np.int64(3), options={"episode": np.uint8(2)})[1]["pose"]  # pyright: ignore[reportArgumentType]
    assert one.tolist() == two.tolist()
    env.close()


@pytest.mark.parametrize("episodes", [None, 3, [], "12", [None], [[0], [1]], {0.5}])
def test_episodes_that_are_no_numbers(episodes: Any) -> None:
    with pytest.raises(ValueError, match=r"expected (at least one|a) whole number"):
        sim.rollout(sim.Teacher(), episodes=episodes)


@pytest.mark.parametrize(
    "action",
    [[1 + 2j, 0], np.array([1j, 0]), ["1", "0"], ["a", "b"], [None, 0.0], None, [[1.0], [1.0, 2.0]]],
)
def test_actions_are_real_numbers(action: Any) -> None:
    env = sim.CorralEscapeEnv()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"commands (are|have|cannot)"):
        env.step(action)
    with pytest.raises(ValueError, match=r"episode 0, step 0: "):
        sim.rollout(lambda *_: [action], episodes=[0])  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match=r"sensors (are|have|cannot)"):
        sim.Teacher().rule([action])  # pyright: ignore[reportArgumentType]
    env.close()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: sim.CorralEscapeVectorEnv(0), "num_envs 0; expected"),
        (lambda: sim.CorralEscapeVectorEnv(2.5), "num_envs 2.5; expected"),  # pyright: ignore[reportArgumentType]
        (lambda: sim.CorralEscapeVectorEnv(2, max_episode_steps=0), "max_episode_steps 0; expected"),
        (lambda: sim.CorralEscapeEnv(dwell="2"), "time '2'; expected a real number"),  # pyright: ignore[reportArgumentType]
        (lambda: sim.CorralEscapeEnv(dwell=1e308), "1e.308 s; expected a finite time"),
        (lambda: sim.CorralEscapeEnv(body=["planar"]), "unknown body"),  # pyright: ignore[reportArgumentType]
        (lambda: sim.CorralEscapeEnv(arena=["default"]), "unknown arena"),  # pyright: ignore[reportArgumentType]
        (lambda: sim.corral(side=-1.0), "Box.half_x is -0.5; expected"),
        (lambda: sim.rollout(sim.Teacher(), robots=1.5), "robots 1.5; expected"),  # pyright: ignore[reportArgumentType]
        (lambda: sim.rollout(sim.Teacher(), workers=True), "workers True; expected"),
    ],
)
def test_odd_settings_are_named(make: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()
