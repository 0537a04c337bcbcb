"""Rollouts: robots that sense, recall and drive. All times are seconds per robot and control step."""

import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AsyncVectorEnv, VectorEnv
from numpy.typing import NDArray

import sim
from behaviours import ErrorDriven
from benchmarks import corral
from benchmarks.harness import Case
from sim.engines import find_engine

Floats = NDArray[np.float64]

MANY, SOME, FEW = 16384, 4096, 1000
"""Robots in `vector` at once."""


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """The engines with the same controllers, and one process for all robots beside one process for each."""
    dim, starts, seconds = (256, 4, 1.0) if small else (4000, 128, 60.0)
    shown = corral.samples(300 if small else 20_000)
    learned = ErrorDriven(margin=5.0).fit(corral.space(dim, "cpu"), shown).freeze()
    controllers: dict[str, sim.ControllerLike] = {"teacher": sim.Teacher(), "learned": learned}
    for name, controller in controllers.items():
        for robots in (8, 16) if small else (FEW, SOME, MANY):
            yield Case(
                f"robot step, {name}",
                f"vector: robots={robots}",
                lambda index, policy=controller, robots=robots: step_s(policy, "vector", robots, index, seconds),
                {
                    f"bullet, {starts} starts": lambda index, policy=controller: step_s(
                        policy, "bullet", starts, index, seconds
                    )
                },
                partial(check_engines, controller, starts, seconds),
                timed=True,
            )
    for robots in (8, 16) if small else (FEW, SOME, MANY):
        yield Case(
            "robot step, world alone",
            f"vector: robots={robots}",
            lambda index, robots=robots: world_s("vector", robots, 3 if small else 100, index),
            {"bullet, 64 robots": lambda index: world_s("bullet", 4 if small else 64, 3 if small else 40, index)},
            lambda: None,
            timed=True,
        )
    yield from environments(small)


def environments(small: bool) -> Iterator[Case]:
    """The vector environment beside Gymnasium's over single ones, driven by the teacher, who takes next to no time."""
    robots, ticks = (2, 3) if small else (16, 40)  # each of the peer's is a process
    ours = [sim.CorralEscapeVectorEnv(count) for count in ((robots, 8) if small else (robots, SOME, MANY))]
    peer = AsyncVectorEnv([partial(Own, episode) for episode in range(robots)])

    def check() -> None:
        assert np.array_equal(drive(ours[0], ticks)[0], drive(peer, ticks)[0])  # to the last bit

    def seconds(env: VectorEnv[Any, Any, Any], index: int) -> float:
        return drive(env, ticks, index)[1] / ticks / env.num_envs

    for env in ours:
        yield Case(
            "robot step, environment",
            f"robots={env.num_envs} ticks={ticks}",
            lambda index, env=env: seconds(env, index),
            {f"AsyncVectorEnv, {robots} robots": lambda index: seconds(peer, index)},
            check,
            timed=True,
        )
    for env in (*ours, peer):
        env.close()


def step_s(policy: sim.ControllerLike, engine: str, starts: int, seed: int, seconds: float) -> float:
    """Seconds that a rollout takes for each of its robot steps."""
    began = time.perf_counter()
    found = sim.rollout(policy, engine=engine, episodes=range(starts), seed=seed, seconds=seconds, robots=starts,
                        record=False)  # fmt: skip
    return (time.perf_counter() - began) / int(found.steps.sum())


def world_s(engine: str, robots: int, ticks: int, seed: int) -> float:
    """Seconds for each robot and control step of an engine whose robots follow commands that are drawn beforehand."""
    slots, arena = np.arange(robots), sim.find_arena("default")
    commands = np.random.default_rng(seed).uniform(-1, 1, (4, robots, 2))
    with find_engine(engine)(robots, arena, sim.Task(), seed=seed) as world:
        world.reset(slots, slots)
        began = time.perf_counter()
        for tick in range(ticks):
            world.observe(slots)
            world.drive(slots, commands[tick * 4 // ticks])
        return (time.perf_counter() - began) / ticks / robots


def check_engines(policy: sim.ControllerLike, starts: int, seconds: float) -> None:
    """Both engines agree on almost all starts."""
    found = [
        sim.rollout(policy, engine=engine, episodes=range(starts), seconds=seconds, record=False).success
        for engine in sim.ENGINES
    ]
    assert (found[0] == found[1]).mean() > 0.95


class Own(gymnasium.Wrapper[Any, Any, Any, Any]):
    """A single environment that plays one episode of its seed, as its row of the vector environment does."""

    def __init__(self, episode: int) -> None:
        super().__init__(gymnasium.make("CorralEscape-v0"))
        self.episode = episode

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin that episode."""
        return super().reset(seed=seed, options={"episode": self.episode})


def drive(env: VectorEnv[Any, Any, Any], ticks: int, seed: int = 0) -> tuple[Floats, float]:
    """Readings `[ticks + 1, robots, 3]` of a drive from its start, and the seconds that it took after that."""
    # The peer adds a number to the seed for each robot; a list is taken as it is.
    seeds: Any = seed if isinstance(env, sim.CorralEscapeVectorEnv) else [seed] * env.num_envs
    teacher, path = sim.Teacher(), [env.reset(seed=seeds)[0].copy()]
    began = time.perf_counter()
    for _ in range(ticks):
        path.append(env.step(teacher(path[-1]))[0].copy())
    return np.stack(path), time.perf_counter() - began
