"""PPO of stable-baselines3, trained in the corral by reward: a reference without demonstrations.

The environment's own reward is 1 at success and 0 at all other steps. Training adds a potential-based term (Ng, Harada
and Russell 1999) in the straight distance to the lamp, see `TrainingEnv`. That distance comes from the pose in `info`,
so the training is privileged: no other row of the table is told where the lamp is. The trained controller sees the
readings only.
"""

from __future__ import annotations

import copy
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import Box
from numpy.typing import NDArray
from torch import nn

import sim
from sim.engine import control_steps

try:
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecEnv
except ModuleNotFoundError as error:
    raise ImportError(f"the controller ppo needs stable-baselines3: pip install 'torchvsa[rl]' ({error})") from error

ROBOTS = 64
"""Robots that are driven together."""
STEPS = 64
"""Control steps of each robot per update, 3.2 s."""
GAMMA = 0.995
"""Discount per control step: at 20 Hz the horizon 1 / (1 - gamma) is 10 s, about the teacher's time to the lamp."""
LEARNING_RATE = 1e-3
BATCHES = 4
"""Batches of an update."""

Floats = NDArray[np.float64]


class TrainingEnv(VecEnv):
    """Our vector environment as stable-baselines3's, with a dense reward.

    Observations are readings as float32, scaled to [0, 1] by the ranges of their sensors. The reward of a control step
    is the environment's own, plus `gamma * potential(after) - potential(before)`, where the potential is minus the
    straight distance (m) from the robot to the axis of the arena's last lamp, and 0 after success. Such a term leaves
    the order of policies as it is. `infos` are empty, but for `terminal_observation` where an episode ended, and
    `TimeLimit.truncated` where its time ran out.

    Args:
        robots: driven together.
        arena: a name in `sim.ARENAS`, or an `Arena`.
        seconds: longest duration of an episode.
        gamma: the learner's discount.
        options: further arguments of `sim.CorralEscapeVectorEnv`.
    """

    def __init__(
        self,
        robots: int = ROBOTS,
        arena: str | sim.Arena = "default",
        seconds: float = 60.0,
        gamma: float = GAMMA,
        **options: Any,
    ) -> None:
        arena = sim.find_arena(arena)
        self.env = sim.CorralEscapeVectorEnv(
            robots, control_steps(seconds), arena=arena, autoreset_mode="same_step", **options
        )
        self.gamma, self.lamp = gamma, np.array([arena.lamps[-1].x, arena.lamps[-1].y])
        self._potential, self._actions = np.zeros(robots), np.zeros((robots, len(sim.ACTUATORS)))
        readings = self.env.single_observation_space
        assert isinstance(readings, Box)
        self.low, self.high = readings.low, readings.high
        super().__init__(robots, Box(0.0, 1.0, self.low.shape), Box(-1.0, 1.0, (len(sim.ACTUATORS),)))

    def reset(self) -> NDArray[np.float32]:
        """Begin the first episode of each robot, of the seed given to `seed`, if any."""
        readings, info = self.env.reset(seed=self._seeds[0])
        self._reset_seeds()
        self._potential = self.potential(info)
        return self.scaled(readings)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Drive each robot for one control step."""
        readings, reward, terminated, truncated, info = self.env.step(self._actions)
        begun, over = self.potential(info), terminated | truncated
        reached = np.where(terminated, 0.0, np.where(over, self.potential(info.get("final_info", info)), begun))
        reward = reward + self.gamma * reached - self._potential
        self._potential = begun
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(over).tolist():
            last = self.scaled(info["final_obs"][row])
            infos[row] = {"terminal_observation": last, "TimeLimit.truncated": bool(truncated[row])}
        return self.scaled(readings), reward.astype(np.float32), over, infos

    def potential(self, info: dict[str, Any]) -> Floats:
        """Minus the distance of each robot to the lamp, m."""
        return -np.linalg.norm(info["pose"][:, :2] - self.lamp, axis=1)

    def scaled(self, readings: Floats) -> NDArray[np.float32]:
        """Readings in [0, 1]."""
        return ((readings - self.low) / (self.high - self.low)).astype(np.float32)

    def close(self) -> None:
        """Free the engine."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the environment, once for each of its robots."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Not supported: the robots share one environment."""
        raise NotImplementedError("the robots share one environment, whose attributes are fixed")

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Not supported: the robots share one environment."""
        raise NotImplementedError("the robots share one environment; call its methods")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Whether the environment is wrapped: it never is."""
        return [False for _ in self._get_indices(indices)]


class Trained:
    """The mean action of a trained policy, as a controller without memory and without noise."""

    def __init__(self, model: PPO, low: Floats, high: Floats) -> None:
        layers = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
        self.network = nn.Sequential(*copy.deepcopy(layers)).double()
        self.low, self.high = low, high

    @torch.no_grad()
    def __call__(self, sensors: Floats) -> Floats:
        """Commands `[B, 2]` for readings `[B, 3]`."""
        commands = self.network(torch.from_numpy((sensors - self.low) / (self.high - self.low))).numpy()
        # The last bits of a matrix product depend on the number of its rows; a controller's answer must not.
        return np.clip(commands, -1.0, 1.0).round(6)


def trained(
    steps: int,
    seed: int,
    arena: str | sim.Arena = "default",
    seconds: float = 60.0,
    robots: int = ROBOTS,
    progress: Callable[[int], object] | None = None,
    **options: Any,
) -> sim.ControllerLike:
    """Train PPO with an MLP of two times 64 units on one thread, and return it without its exploration.

    The same arguments give the same controller. Its episodes are of another seed than `seed`, whose first episodes are
    the held-out starts. The global random states are left as they were.

    Args:
        steps: control steps to train for, of all robots together; rounded up to whole updates of `STEPS` per robot.
        seed: of the network, its exploration and its episodes.
        arena, seconds, robots, options: see `TrainingEnv`.
        progress: called with the number of new control steps.
    """
    env = TrainingEnv(robots, arena, seconds, **options)

    def advance(*_: object) -> bool:
        if progress is not None:
            progress(robots)
        return True

    with alone():
        model = PPO(
            "MlpPolicy", env, LEARNING_RATE, STEPS, robots * STEPS // BATCHES, gamma=GAMMA,
            seed=int(np.random.SeedSequence([seed, *b"ppo"]).generate_state(1)[0]), device="cpu",
        )  # fmt: skip
        model.learn(steps, callback=advance)
    env.close()
    return Trained(model, env.low, env.high)


@contextmanager
def alone() -> Iterator[None]:
    """Work on one thread, and keep the global random states, which stable-baselines3 seeds and draws from."""
    threads, states = torch.get_num_threads(), (random.getstate(), np.random.get_state())  # noqa: NPY002 (which stable-baselines3 uses)
    torch.set_num_threads(1)
    try:
        with torch.random.fork_rng(devices=[]):
            yield
    finally:
        torch.set_num_threads(threads)
        random.setstate(states[0])
        np.random.set_state(states[1])  # noqa: NPY002 (which stable-baselines3 uses)
