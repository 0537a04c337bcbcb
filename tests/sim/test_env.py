import gymnasium
import numpy as np
import policies
import pybullet
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import sim
from sim.engines.bullet import Bullet
from sim.env import MAX_STEPS

ENGINES = [("vector", "planar"), ("bullet", "planar"), ("bullet", "wheeled")]


@pytest.mark.parametrize(("engine", "body"), ENGINES)
def test_gymnasium_finds_nothing_to_complain_about(engine: str, body: str) -> None:
    # Warnings are errors here, the checker's own included.
    env = gymnasium.make("CorralEscape-v0", engine=engine, body=body)
    check_env(env.unwrapped)
    env.close()


def test_spaces_are_those_of_the_tables() -> None:
    env = gymnasium.make("CorralEscape-v0")
    assert env.observation_space == gymnasium.spaces.Box(np.zeros(3), np.array([5.0, 5.0, 0.6]), dtype=np.float64)
    assert env.action_space == gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float64)
    for bound, channels in ((env.observation_space, sim.SENSORS), (env.action_space, sim.ACTUATORS)):
        assert isinstance(bound, gymnasium.spaces.Box)
        assert bound.high.tolist() == [channel.high for channel in channels]
    assert env.spec is not None
    assert env.spec.max_episode_steps == MAX_STEPS == 1200
    env.close()


def test_an_episode_is_that_of_a_rollout() -> None:
    run = sim.rollout(sim.Teacher(), seed=4, episodes=[0, 1, 5])
    env = gymnasium.make("CorralEscape-v0")
    teacher = sim.Teacher()
    for episode in (0, 1, 5):
        # Seeding begins episode 0, another reset the next; an option picks any.
        seen, info = env.reset(seed=4 if episode == 0 else None, options={"episode": 5} if episode == 5 else None)
        path = run.slice(episode)
        for step in range(len(path)):
            assert np.array_equal(seen, path.sensors[step])
            assert info["pose"].tolist() == [path.x[step], path.y[step], path.heading[step]]
            seen, reward, terminated, truncated, info = env.step(teacher(seen[None])[0])
            assert (reward, terminated) == ((1.0, True) if step == len(path) - 1 else (0.0, False))
            assert not truncated
        assert info["success"]
        assert info["escaped"]
        assert info["episode"] == episode
    env.close()


def test_time_runs_out() -> None:
    env = gymnasium.make("CorralEscape-v0", max_episode_steps=30)
    env.reset(seed=0)
    ends = [env.step(np.zeros(2))[2:4] for _ in range(30)]
    assert ends == [(False, False)] * 29 + [(False, True)]
    env.close()


def test_an_unseeded_environment_draws_a_seed_of_its_own() -> None:
    starts = []
    for _ in range(2):
        env = sim.CorralEscapeEnv()
        starts.append(env.reset()[1]["pose"].tolist())
        env.close()
    assert starts[0] != starts[1]


def test_vector_and_scalar_agree_step_by_step() -> None:
    limit, seed = 160, 2
    vector = gymnasium.make_vec("CorralEscape-v0", num_envs=3, max_episode_steps=limit)
    scalars = [gymnasium.make("CorralEscape-v0", max_episode_steps=limit) for _ in range(3)]
    seen, _ = vector.reset(seed=seed)
    alone = [env.reset(seed=seed, options={"episode": i})[0] for i, env in enumerate(scalars)]
    assert np.array_equal(seen, alone)
    teacher, over, ended, episodes = sim.Teacher(), [False] * 3, 0, [0, 1, 2]
    for step in range(500):
        actions = teacher(seen) if step % 7 else policies.random.commands(seen, np.arange(3), np.full(3, step))
        seen, rewards, terminated, truncated, infos = vector.step(actions)
        for i, env in enumerate(scalars):
            if over[i]:
                episodes[i] += 3
                one, info = env.reset(options={"episode": episodes[i]})
                expected = (0.0, False, False)
                ended += 1
            else:
                one, *rest, info = env.step(actions[i])
                expected = tuple(rest)
            assert np.array_equal(seen[i], one)
            assert (rewards[i], terminated[i], truncated[i]) == expected
            assert infos["pose"][i].tolist() == info["pose"].tolist()
            assert infos["episode"][i] == info["episode"]
            over[i] = bool(terminated[i] or truncated[i])
    assert ended >= 6
    vector.close()
    for env in scalars:
        env.close()


def test_the_vector_environment_states_its_autoreset_mode() -> None:
    vector = gymnasium.make_vec("CorralEscape-v0", num_envs=2)
    assert vector.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    assert np.asarray(vector.reset(seed=0)[0]).shape == (2, 3)
    vector.close()


@pytest.mark.parametrize(("engine", "body"), ENGINES)
def test_pictures_show_lamp_walls_and_a_robot_that_moves(engine: str, body: str) -> None:
    env = gymnasium.make("CorralEscape-v0", render_mode="rgb_array", engine=engine, body=body)
    env.reset(seed=1)
    before = env.render()
    assert isinstance(before, np.ndarray)
    assert before.shape == (360, 480, 3)
    red, green, blue = before.astype(int).transpose(2, 0, 1)
    lamp = (red > 150) & (green > 100) & (blue < 80)
    robot = (blue > 100) & (red < 80)
    assert 200 < lamp.sum() < 3000
    assert 100 < robot.sum() < 3000
    # The lamp is to the right of the robot and of the corral's middle.
    assert np.nonzero(lamp)[1].mean() > 400 > np.nonzero(robot)[1].mean()
    for _ in range(20):
        env.step(np.ones(2))
    after = env.render()
    assert isinstance(after, np.ndarray)
    assert (before != after).any(axis=2).sum() > 200
    env.close()


def test_vector_pictures_are_one_each() -> None:
    vector = gymnasium.make_vec("CorralEscape-v0", num_envs=2, render_mode="rgb_array")
    vector.reset(seed=0)
    pictures = vector.render()
    assert pictures is not None
    assert [np.asarray(picture).shape for picture in pictures] == [(360, 480, 3)] * 2
    assert not np.array_equal(pictures[0], pictures[1])
    vector.close()


def test_closing_twice_is_fine() -> None:
    env = sim.CorralEscapeEnv(engine="bullet")
    assert isinstance(env._state.engine, Bullet)
    client = env._state.engine.worlds[0].client
    assert pybullet.getConnectionInfo(client)["isConnected"]
    env.close()
    env.close()
    assert not pybullet.getConnectionInfo(client)["isConnected"]


def test_misuse_is_named() -> None:
    with pytest.raises(ValueError, match="render_mode 'human'"):
        sim.CorralEscapeEnv(render_mode="human")
    with pytest.raises(ValueError, match="unknown arena"):
        sim.CorralEscapeEnv(arena="maze")
    env = sim.CorralEscapeEnv()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(2))
    with pytest.raises(ValueError, match="unknown reset options"):
        env.reset(options={"start": 3})
    env.reset(seed=0)
    with pytest.raises(ValueError, match="expected finite commands"):
        env.step(np.array([np.nan, 0.0]))
    with pytest.raises(ValueError, match="commands have shape"):
        env.step(np.zeros(3))
    env.close()
    vector = sim.CorralEscapeVectorEnv(2)
    with pytest.raises(gymnasium.error.ResetNeeded):
        vector.step(np.zeros((2, 2)))
    with pytest.raises(ValueError, match="takes none"):
        vector.reset(options={"episode": 3})
    vector.close()
