"""The Gymnasium environment `CorralEscape-v0`, for many robots at once."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sim.arena import Arena
from sim.checks import whole_number
from sim.engine import State, check_commands
from sim.env_state import MAX_STEPS, EnvState, Flags, Floats, box, check_render_mode
from sim.robot import ACTUATORS, CONTROL_HZ
from sim.task import Task
from sim.tracker import DWELL_SECONDS

AUTORESET = {"next_step": AutoresetMode.NEXT_STEP, "same_step": AutoresetMode.SAME_STEP}
"""Gymnasium's autoreset modes that the environment has, by name."""


def with_rows(state: State, rows: NDArray[np.int64], other: State) -> State:
    """A state in which `rows` are those of another one."""
    columns = {field.name: getattr(state, field.name).copy() for field in fields(State)}
    for name, column in columns.items():
        column[rows] = getattr(other, name)
    return State(**columns)


class CorralEscapeVectorEnv(VectorEnv[NDArray[Any], NDArray[Any], NDArray[Any]]):
    """`num_envs` independent copies of `CorralEscapeEnv`, each with the same bits as a single one.

    With `reset(seed=s)`, environment `i` plays the episodes `i`, `i + num_envs`, `i + 2 * num_envs`, ... of seed `s`.
    `info` holds the same entries as arrays. `max_episode_steps` truncates episodes.

    `autoreset_mode` says when the next episode begins. Both modes play the same episodes:

    - `"next_step"`: the step after the last one of an episode ignores that row's action and returns the first
      observation of its next episode, with reward 0.
    - `"same_step"`: the last step of an episode returns the first observation of the next one, with the reward and the
      end of the last step. Where episodes ended, `info` has `final_obs` (`[num_envs]`, the last observations; None in
      the other rows), `final_info` (the other entries of `info` before the reset, for all rows), and the masks
      `_final_obs` and `_final_info` of the rows that ended.

    The other arguments are those of `CorralEscapeEnv`. Raises `ValueError` for unknown names and numbers out of range.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": CONTROL_HZ}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = MAX_STEPS,
        arena: str | Arena = "default",
        body: str | None = None,
        dwell: float = DWELL_SECONDS,
        render_mode: str | None = None,
        engine: str = "vector",
        task: Task | None = None,
        autoreset_mode: Literal["next_step", "same_step"] | AutoresetMode = "next_step",
    ) -> None:
        check_render_mode(render_mode)
        mode = AUTORESET.get(autoreset_mode) if isinstance(autoreset_mode, str) else autoreset_mode
        if mode not in AUTORESET.values():
            raise ValueError(f"autoreset_mode {autoreset_mode!r}; expected one of {', '.join(map(repr, AUTORESET))}")
        self.metadata = {**self.metadata, "autoreset_mode": mode}
        num_envs = whole_number("num_envs", num_envs, 1)
        max_episode_steps = whole_number("max_episode_steps", max_episode_steps, 1)
        self.num_envs = num_envs
        self.render_mode = render_mode
        self._state = EnvState(num_envs, arena, body, dwell, engine, task)
        self.single_observation_space = box(self._state.task.sensors)
        self.single_action_space = box(ACTUATORS)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._max_episode_steps = max_episode_steps
        self._same_step = mode is AutoresetMode.SAME_STEP
        self._over = np.zeros(num_envs, dtype=np.bool_)
        self._ready = False

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        """Begin the first episode of every environment. Raises `ValueError` for any option or a bad seed."""
        self._state.check_open()
        if options:
            raise ValueError(f"unknown reset options {sorted(map(str, options))}; the vector environment takes none")
        seed = None if seed is None else whole_number("seed", seed)
        super().reset(seed=seed)
        self._state.engine.seed = int(self.np_random.integers(2**31)) if seed is None else seed
        self._state.reset(self._state.slots, self._state.slots)
        self._over[:] = False
        self._ready = True
        state = self._state.observe()
        return state.sensors, self._state.info(state)

    def step(self, actions: Floats) -> tuple[Floats, Floats, Flags, Flags, dict[str, Any]]:
        """Drive each robot for one control step. A row whose episode is over begins its next one."""
        self._state.check_open()
        if not self._ready:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        commands = check_commands(actions, self.num_envs)
        driven, over = np.flatnonzero(~self._over), np.flatnonzero(self._over)
        if driven.size:
            self._state.drive(driven, commands[driven])
        if over.size:
            self._begin_next(over)
        state = self._state.observe()
        terminated = self._state.tracker.success.copy()
        truncated = ~terminated & (self._state.tracker.clock >= self._max_episode_steps)
        ended, last = terminated | truncated, {}
        if not self._same_step:
            self._over = ended
        elif ended.any():
            last = {"final_obs": np.full(self.num_envs, None, dtype=object), "_final_obs": ended}
            last |= {"final_info": self._state.info(state), "_final_info": ended.copy()}
            rows = np.flatnonzero(ended)
            for row in rows:
                last["final_obs"][row] = state.sensors[row]
            self._begin_next(rows)
            state = with_rows(state, rows, self._state.observe(rows))
        reward = terminated.astype(np.float64)
        return state.sensors, reward, terminated, truncated, {**self._state.info(state), **last}

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """One picture `[H, W, 3]` per environment, or None without a render mode."""
        if self.render_mode is None:
            return None
        self._state.check_open()
        return tuple(self._state.engine.picture(slot) for slot in range(self.num_envs))

    def _begin_next(self, slots: NDArray[np.int64]) -> None:
        self._state.reset(slots, self._state.episodes[slots] + self.num_envs)

    def close_extras(self, **_: Any) -> None:
        """Free the engine."""
        self._state.engine.close()
