"""Classic control tasks of Gymnasium, each with an expert of a few lines to learn from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Controller = Callable[[Floats], NDArray[Any]]
"""Actions `[B]` or `[B, m]` for observations `[B, n]`."""


class Episodes(NamedTuple):
    """What was seen and done, a row for each step, and the return of each episode."""

    observations: Floats
    actions: NDArray[Any]
    returns: Floats


def cart_pole(seen: Floats) -> NDArray[np.int64]:
    """Push toward the side to which the pole will fall, and the cart back to the middle."""
    place, speed, angle, turn = seen.T
    return (angle + 0.25 * turn + 0.02 * place + 0.06 * speed > 0).astype(np.int64)


def acrobot(seen: Floats) -> NDArray[np.int64]:
    """Swing the lower link against the upper one, which pumps energy in."""
    return np.where(seen[:, 4] > 0, 0, 2)


def mountain_car(seen: Floats) -> NDArray[np.int64]:
    """Push in the direction of motion."""
    return np.where(seen[:, 1] < 0, 0, 2)


def lunar_lander(seen: Floats) -> NDArray[np.int64]:
    """Gymnasium's own heuristic."""
    from gymnasium.envs.box2d.lunar_lander import heuristic

    # It asks the environment for one thing.
    env: Any = SimpleNamespace(unwrapped=SimpleNamespace(continuous=False), continuous=False)
    return np.array([heuristic(env, row) for row in seen])


def pendulum(seen: Floats) -> Floats:
    """Pump energy in until the pendulum is nearly up, then hold it there."""
    cosine, sine, turn = seen.T
    angle = np.arctan2(sine, cosine)
    missing = 15 * (1 - cosine) - turn**2 / 2  # of the energy at the top
    swing, hold = np.where(turn < 0, -1, 1) * missing, -12 * angle - 3 * turn
    return np.clip(np.where(np.abs(angle) < 0.5, hold, swing), -2, 2)[:, None]


EXPERTS: dict[str, Controller] = {
    "CartPole-v1": cart_pole,
    "Acrobot-v1": acrobot,
    "MountainCar-v0": mountain_car,
    "LunarLander-v3": lunar_lander,
    "Pendulum-v1": pendulum,
}
"""The expert of each task."""


def run(task: str, controller: Controller, seeds: Sequence[int]) -> Episodes:
    """An episode from each start, all side by side; what comes after the first end of each is left out."""
    made: Any = gymnasium.make_vec(task, len(seeds), vectorization_mode="sync")
    seen, _ = made.reset(seed=list(seeds))
    alive, returns = np.ones(len(seeds), dtype=np.bool_), np.zeros(len(seeds))
    steps: list[tuple[Floats, NDArray[Any], NDArray[np.bool_]]] = []
    while alive.any():
        actions = controller(np.asarray(seen, dtype=np.float64))
        steps.append((np.asarray(seen, dtype=np.float64), actions, alive.copy()))
        seen, reward, terminated, truncated, _ = made.step(actions)
        returns += np.where(alive, reward, 0)
        alive &= ~(terminated | truncated)
    made.close()
    rows = [(here[on], done[on]) for here, done, on in steps]
    return Episodes(np.concatenate([row[0] for row in rows]), np.concatenate([row[1] for row in rows]), returns)
