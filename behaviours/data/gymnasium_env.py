"""Gymnasium environments: recorded episodes, and what a program needs to drive."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64

from behaviours import env_spaces
from behaviours.data.log import Log
from behaviours.options import as_int
from behaviours.progress import Progress, no_progress
from behaviours.schema import Schema


def collect(
    env: Any,
    controller: Callable[[Any], Any],
    episodes: int,
    seed: int = 0,
    *,
    most_steps: int | None = None,
    sensors: Sequence[str] | None = None,
    actuators: Sequence[str] | None = None,
    progress: Progress = no_progress,
) -> Log:
    """Let a controller drive an environment, and record what it saw and did.

        log = collect(gymnasium.make("CartPole-v1"), lambda seen: int(seen[2] + seen[3] > 0), episodes=5)

    A row is an observation and the action that answered it. Episode i starts from `env.reset(seed=seed + i)` and ends
    where the environment terminates or truncates it; its number is i. The observation after the last action is not
    recorded. Environment and controller that are deterministic give the same log for the same seed.

    Args:
        env: A single environment, not a vector of them.
        controller: The action for an observation, both as the environment has them.
        episodes: How many, at least 1.
        seed: The seed of the first episode.
        most_steps: End each episode after this many steps, for environments without a time limit.
        sensors: Names for the elements of observations, in order; by default such as `observation[2]`.
        actuators: Names for the elements of actions, in order; by default such as `action.arm`.
        progress: Called after each episode.

    Raises:
        ValueError: For observations without numbers, actions that are not numbers, another number of names, and
            actions of a wrong size.
    """
    episodes = as_int("episodes", episodes, 1)
    most_steps = None if most_steps is None else as_int("most_steps", most_steps, 1)
    if hasattr(env, "num_envs"):
        raise ValueError("collect takes a single environment; got a vector of environments")
    observed, left_out = env_spaces.elements_of(env.observation_space, "observation", sensors)
    commanded = env_spaces.actions_of(env.action_space, actuators)
    seen_rows: list[np.ndarray[Any, Any]] = []
    done_rows: list[np.ndarray[Any, Any]] = []
    lengths = []
    for episode in range(episodes):
        (seen, _), over, steps = env.reset(seed=seed + episode), False, 0
        while not over and (most_steps is None or steps < most_steps):
            # Read before the controller, which may change it.
            seen_rows.append(env_spaces.rows_of(observed, seen, 1)[0])
            action = controller(seen)
            done_rows.append(env_spaces.rows_of(commanded, action, 1)[0])
            seen, _, ended, cut, _ = env.step(action)
            over, steps = bool(ended or cut), steps + 1
        lengths.append(steps)
        progress((episode + 1) / episodes)
    elements = (*observed, *commanded)
    columns = np.concatenate([np.stack(seen_rows), np.stack(done_rows)], 1).T
    return Log(
        {element.name: np.ascontiguousarray(column) for element, column in zip(elements, columns, strict=True)},
        ranges={element.name: (element.low, element.high) for element in elements if element.bounded},
        episodes=np.repeat(np.arange(episodes), lengths),
        sensors=[element.name for element in observed],
        actuators=[element.name for element in commanded],
        left_out=left_out,
    )


def schema_from_env(env: Any, shown: Log | None = None) -> Schema:
    """The schema of an environment; infinite bounds are learned from `shown`. See `Schema.from_env`."""
    return Schema.from_env(env, shown)


def readings_of(env: Any, observation: Any) -> Float64[np.ndarray, "n"]:
    """An observation as a row of readings `[n]`, in the order of `Schema.from_env`.

    Raises `ValueError` for an observation of another size.
    """
    return env_spaces.rows_of(env_spaces.elements_of(env.observation_space, "observation")[0], observation, 1)[0]


def action_of(env: Any, commands: Any) -> Any:
    """The action for a row of commands `[m]` in the order of `Schema.from_env`, of the type that `env.step` takes.

        recall = drive([readings_of(env, seen)])
        seen, *_ = env.step(action_of(env, recall.commands[0]))

    Raises `ValueError` for another number of commands, and for commands that are not finite, as where nobody answers.
    """
    return env_spaces.action_of(env.action_space, commands)
