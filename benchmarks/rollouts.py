"""Rollouts: robots that sense, recall and drive."""

from collections.abc import Callable, Iterator
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

Floats = NDArray[np.float64]


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """64 robots on both bodies. One process asks for all robots at once; the peer has one process per robot."""
    robots, ticks, dim = (2, 3, 256) if small else (64, 40, 4000)
    shown = corral.samples(300 if small else 20_000)
    mind = ErrorDriven(margin=5.0).fit(corral.space(dim, "cpu"), shown)

    def together(readings: Floats) -> Floats:
        return mind(readings).commands.numpy()

    def one_by_one(readings: Floats) -> Floats:
        return np.concatenate([mind(readings[row : row + 1]).commands.numpy() for row in range(len(readings))])

    for body in ("planar", "wheeled"):
        ours = sim.CorralEscapeVectorEnv(robots, body=body)
        peer = AsyncVectorEnv([partial(Own, body, episode) for episode in range(robots)])

        def check(ours=ours, peer=peer) -> None:
            mine, theirs = drive(ours, together, ticks), drive(peer, one_by_one, ticks)
            assert np.array_equal(mine, theirs)  # the same trajectories, to the last bit

        yield Case(
            f"rollouts, {body}",
            f"robots={robots} ticks={ticks}",
            lambda index, env=ours: drive(env, together, ticks, index),
            {"AsyncVectorEnv": lambda index, env=peer: drive(env, one_by_one, ticks, index)},
            check,
            more={"robot_steps": robots * ticks},
        )
        ours.close()
        peer.close()


class Own(gymnasium.Wrapper[Any, Any, Any, Any]):
    """A single environment that plays one episode of its seed, as its row of the vector environment does."""

    def __init__(self, body: str, episode: int) -> None:
        super().__init__(gymnasium.make("CorralEscape-v0", body=body))
        self.episode = episode

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin that episode."""
        return super().reset(seed=seed, options={"episode": self.episode})


def drive(env: VectorEnv[Any, Any, Any], ask: Callable[[Floats], Floats], ticks: int, seed: int = 0) -> Floats:
    """Readings `[ticks + 1, robots, 3]` of a drive from its start."""
    # The peer adds a number to the seed for each robot; a list is taken as it is.
    seeds: Any = seed if isinstance(env, sim.CorralEscapeVectorEnv) else [seed] * env.num_envs
    path = [env.reset(seed=seeds)[0].copy()]
    for _ in range(ticks):
        path.append(env.step(ask(path[-1]))[0].copy())
    return np.stack(path)
