"""stable-baselines3 on our environments: the adapter, PPO, and its row of the table."""

import random
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from small_run import settings, small_run
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env

import sim
from experiments.corral import study
from experiments.corral.controllers import CONTROLLERS
from experiments.kit.run import check_all
from experiments.models.ppo import GAMMA, Trained, TrainingEnv, trained

SECONDS, LIMIT, SEED = 11.5, 230, 5  # some of the teacher's episodes end at the lamp, others run out of time
ROBOTS = 3


def test_stable_baselines3_finds_nothing_to_complain_about() -> None:
    env = sim.CorralEscapeEnv()
    # Its only advice. Our commands are float64, as in a rollout, so that both have the same bits.
    with pytest.warns(UserWarning, match="action space has dtype float64") as found:
        check_env(env, skip_render_check=True)
    assert len(found) == 1
    env.close()


def test_the_adapter_plays_the_episodes_of_the_environment() -> None:
    env, teacher = TrainingEnv(ROBOTS, seconds=SECONDS), sim.Teacher()
    other = sim.CorralEscapeVectorEnv(ROBOTS, LIMIT, autoreset_mode="same_step")
    env.seed(SEED)
    seen, (readings, info) = np.asarray(env.reset()), other.reset(seed=SEED)
    ends = set()
    for _ in range(300):
        assert seen.dtype == np.float32
        assert seen == pytest.approx(readings / [5.0, 5.0, 0.6], abs=1e-6)
        actions = teacher(readings)
        distance = np.hypot(info["pose"][:, 0] - 2.3, info["pose"][:, 1])
        readings, own, terminated, truncated, info = other.step(actions)
        step, reward, over, infos = env.step(actions)
        seen = np.asarray(step)
        assert over.tolist() == (terminated | truncated).tolist()
        for row in range(ROBOTS):
            pose = info["final_info"]["pose"][row] if over[row] else info["pose"][row]
            potential = 0.0 if terminated[row] else -np.hypot(pose[0] - 2.3, pose[1])
            assert reward[row] == pytest.approx(own[row] + GAMMA * potential + distance[row], abs=1e-6)
            if over[row]:
                last = infos[row].pop("terminal_observation")
                assert last == pytest.approx(info["final_obs"][row] / [5.0, 5.0, 0.6], abs=1e-6)
                assert infos[row].pop("TimeLimit.truncated") == truncated[row]
                ends.add(bool(truncated[row]))
        assert infos == [{}] * ROBOTS
    assert ends == {False, True}
    env.close()
    other.close()


def test_the_shaping_adds_up_to_the_potential_of_the_start() -> None:
    env, teacher = TrainingEnv(ROBOTS, seconds=SECONDS), sim.Teacher()
    env.seed(SEED)
    seen, start = np.asarray(env.reset()), env._potential.copy()
    total, discount, going = np.zeros(ROBOTS), 1.0, np.ones(ROBOTS, dtype=bool)
    succeeded = 0
    while going.any():
        step, reward, over, infos = env.step(teacher(seen.astype(np.float64) * [5.0, 5.0, 0.6]))
        seen = np.asarray(step)
        total += going * discount * reward
        for row in np.flatnonzero(over & going):
            if not infos[row]["TimeLimit.truncated"]:
                assert total[row] == pytest.approx(discount - start[row], abs=1e-4)
                succeeded += 1
        going &= ~over
        discount *= GAMMA
    assert succeeded
    env.close()


def test_the_adapter_is_an_environment_of_stable_baselines3() -> None:
    env = TrainingEnv(ROBOTS)
    assert env.get_attr("render_mode") == [None] * ROBOTS
    assert env.get_attr("num_envs", [0]) == [ROBOTS]
    assert env.env_is_wrapped(object) == [False] * ROBOTS
    for refused in (lambda: env.set_attr("num_envs", 2), lambda: env.env_method("render")):
        with pytest.raises(NotImplementedError, match="share one environment"):
            refused()
    assert np.shape(env.reset()) == (ROBOTS, 3)
    env.close()


def global_states() -> list[str]:
    return [str(random.getstate()), str(np.random.get_state()), str(torch.get_rng_state().tolist())]  # noqa: NPY002


def test_ppo_trains_and_the_same_seed_gives_the_same_controller() -> None:
    counted: list[int] = []
    before = global_states()
    first, again, other = (trained(4096, seed, seconds=10, robots=16, progress=counted.append) for seed in (0, 0, 1))
    assert global_states() == before
    assert sum(counted) == 3 * 4096
    assert isinstance(first, Trained)
    readings = np.random.default_rng(0).uniform(0, [5, 5, 0.6], (50, 3))
    commands = first(readings)
    assert np.array_equal(commands, again(readings))  # pyright: ignore[reportCallIssue]
    assert not np.array_equal(commands, other(readings))  # pyright: ignore[reportCallIssue]
    assert np.abs(commands).max() <= 1
    assert np.array_equal(commands, np.concatenate([first(row[None]) for row in readings]))
    # It learned something: the mean command is no longer that of an untrained network, near 0.
    assert np.abs(commands).mean() > 0.1


def test_the_controller_is_the_deterministic_policy() -> None:
    env = TrainingEnv(ROBOTS)
    model = PPO("MlpPolicy", env, n_steps=32, batch_size=96, seed=0, device="cpu", learning_rate=0.01)
    model.learn(96)
    readings = np.random.default_rng(0).uniform(0, [5, 5, 0.6], (50, 3))
    wanted, _ = model.predict(env.scaled(readings), deterministic=True)
    assert Trained(model, env.low, env.high)(readings) == pytest.approx(wanted, abs=1e-5)
    env.close()


@pytest.mark.slow
def test_thirty_thousand_steps_improve_the_reward() -> None:
    def gained(policy: sim.ControllerLike) -> float:
        """How much nearer to the lamp an episode ends than it began, m."""
        run = sim.rollout(policy, episodes=range(100), seconds=20)
        x, y = run.trajectory.x, run.trajectory.y
        distance, last = np.hypot(x - 2.3, y), run.offsets[1:] - 1
        return float((distance[run.offsets[:-1]] - distance[last]).mean())

    assert gained(trained(30_000, 0, seconds=20)) > gained(trained(1, 0, seconds=20, robots=2)) + 0.2


def test_its_row_asks_for_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "ppo" in CONTROLLERS
    assert "ppo" not in settings().controllers
    chosen = settings("controllers=[ppo]")
    check_all(study, chosen)
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    with pytest.raises(ValueError, match=r"controllers: ppo needs stable-baselines3: pip install 'torchvsa\[rl\]'$"):
        check_all(study, chosen)


def test_the_row_is_driven(tmp_path: Path) -> None:
    outcome = small_run(tmp_path, "controllers=[mlp,ppo]", "ppo_steps=2000", "animate=false")
    rows = {row["controller"]: row for row in outcome.table}
    assert rows["mlp"]["heldout_agreement"] > 0.9
    assert rows["ppo"]["episodes"] == 8
    assert rows["ppo"]["pairs_stored"] is rows["ppo"]["bins"] is None
