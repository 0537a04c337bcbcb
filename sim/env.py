"""The Gymnasium environment `CorralEscape-v0`, for one robot or many. `import sim` registers it."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sim.arena import Arena
from sim.arenas import find_arena
from sim.channel import Channel
from sim.checks import whole_number
from sim.engine import State, check_commands, control_steps
from sim.engines import find_engine
from sim.robot import ACTUATORS, CONTROL_HZ
from sim.task import Task
from sim.tracker import DWELL_SECONDS, Tracker

MAX_STEPS = 60 * CONTROL_HZ
"""Gymnasium truncates an episode after this many control steps (60 s)."""

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


def _box(channels: tuple[Channel, ...]) -> spaces.Box:
    low, high = np.array([(channel.low, channel.high) for channel in channels]).T
    return spaces.Box(low, high, dtype=np.float64)


def _check_render_mode(render_mode: str | None) -> None:
    if render_mode not in (None, "rgb_array"):
        raise ValueError(f"render_mode {render_mode!r}; expected None or 'rgb_array'")


class _EnvState:
    """The state that both environments share: the robots, their episodes, and the progress of each."""

    def __init__(
        self, size: int, arena: str | Arena, body: str | None, dwell: float, engine: str, task: Task | None
    ) -> None:
        arena = find_arena(arena)
        self.task = Task.of(arena) if task is None else task
        self.task.check(arena)
        self.slots = np.arange(size)
        self.tracker = Tracker(size, control_steps(dwell), len(self.task.goals))
        self.engine = find_engine(engine)(size, arena, self.task, body)
        self.episodes = np.zeros(size, dtype=np.int64)

    def reset(self, slots: NDArray[np.int64], episodes: NDArray[np.int64]) -> None:
        self.engine.reset(slots, episodes)
        self.tracker.reset(slots)
        self.episodes[slots] = episodes

    def check_open(self) -> None:
        """Raise if the engine is closed."""
        if self.engine.closed:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed; make a new one")

    def observe(self) -> State:
        state = self.engine.observe(self.slots)
        self.tracker.observe(self.slots, state)
        return state

    def drive(self, slots: NDArray[np.int64], action: object) -> None:
        commands = check_commands(action, len(slots))
        if not np.isfinite(commands).all():
            raise ValueError(f"action {commands.tolist()}; expected finite commands in [-1, 1]")
        self.engine.drive(slots, commands)

    def info(self, state: State) -> dict[str, NDArray[Any]]:
        return {
            "episode": self.episodes.copy(),
            "pose": np.stack([state.x, state.y, state.heading], axis=1),
            "contact": state.contact,
            "at_lamp": self.tracker.at_goal.copy(),
            "escaped": self.tracker.escaped.copy(),
            "success": self.tracker.success.copy(),
        }


class CorralEscapeEnv(gymnasium.Env[NDArray[Any], NDArray[Any]]):
    """
    ## Description

    A round robot with a differential drive starts in a square corral with one gap. A lamp is outside, beyond the gap.
    The robot has to find the lamp and to stay there. This is the corral-escape task of Neubert et al. 2016,
    section IV; `sim.Teacher` solves it with five if-else rules.

    ## Action space

    `Box(-1, 1, (2,), float64)`; values outside are clipped. One action lasts one control step, 1/20 s.

    | index | command     | min | max | unit                             |
    |-------|-------------|-----|-----|----------------------------------|
    | 0     | left wheel  | -1  | 1   | fraction of full speed (0.4 m/s) |
    | 1     | right wheel | -1  | 1   | fraction of full speed (0.4 m/s) |

    Each wheel turns with its commanded speed times `1 + wheel_noise * N(0, 1)`, drawn for each control step.

    ## Observation space

    `Box(0, high, (3,), float64)`, without noise.

    | index | reading     | min | max | unit | at its maximum where                                         |
    |-------|-------------|-----|-----|------|--------------------------------------------------------------|
    | 0     | light left  | 0   | 5   | m    | the lamp is out of the cone, beyond 4.5 m or behind a wall   |
    | 1     | light right | 0   | 5   | m    | the same, for the right sensor                               |
    | 2     | distance    | 0   | 0.6 | m    | none of the three beams ahead meets a wall                   |

    ## Reward

    1 for the control step that completes the dwell time at the lamp, 0 for all others.

    ## Start

    Uniform over the corral without a margin, any heading. `reset(seed=s)` begins episode 0 of seed `s`, and each
    further `reset()` the next one. `reset(options={"episode": k})` begins episode `k`. The start and the wheel noise
    depend only on (seed, episode): they equal those of `sim.rollout(..., seed=s, episodes=[k])`.

    ## End

    Terminated: the robot touched the lamp in every state of the dwell time. Truncated: after 1,200 control steps
    (60 s), by Gymnasium's time limit.

    `info` holds `episode`, `pose` (x, y in m, heading in rad), `contact` (with an obstacle), `at_lamp` (of its goal),
    `escaped` (was outside the corral) and `success`.

    ## Arguments

    | argument      | default     | meaning                                                            |
    |---------------|-------------|--------------------------------------------------------------------|
    | `arena`       | `"default"` | a name in `sim.ARENAS`, or an `Arena`                              |
    | `body`        | None        | `planar`; `wheeled` stands on wheels, in `bullet` only             |
    | `dwell`       | 2.0         | seconds at the lamp that make a success                            |
    | `render_mode` | None        | `"rgb_array"`: a picture `[H, W, 3]` uint8, drawn by pybullet      |
    | `engine`      | `"vector"`  | a name in `sim.ENGINES`                                            |
    | `task`        | None        | sensors and goals, by default `Task.of(arena)`                     |

    ## Versions

    * v0: first version.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": CONTROL_HZ}  # noqa: RUF012

    def __init__(
        self,
        arena: str | Arena = "default",
        body: str | None = None,
        dwell: float = DWELL_SECONDS,
        render_mode: str | None = None,
        engine: str = "vector",
        task: Task | None = None,
    ) -> None:
        _check_render_mode(render_mode)
        self.render_mode = render_mode
        self._state = _EnvState(1, arena, body, dwell, engine, task)
        self.observation_space = _box(self._state.task.sensors)
        self.action_space = _box(ACTUATORS)
        self._episode: int | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode as described under "Start".

        Raises `ValueError` for options other than `episode`, and unless seed and episode are whole numbers, 0 or more.
        """
        self._state.check_open()
        unknown = set(options or {}) - {"episode"}
        if unknown:
            raise ValueError(f"unknown reset options {sorted(map(str, unknown))}; expected only 'episode'")
        requested = whole_number("episode", options["episode"]) if options else None
        seed = None if seed is None else whole_number("seed", seed)
        super().reset(seed=seed)
        before = self._episode
        if seed is not None or before is None:
            self._state.engine.seed = int(self.np_random.integers(2**31)) if seed is None else seed
            before = -1
        self._episode = before + 1 if requested is None else requested
        self._state.reset(self._state.slots, np.array([self._episode]))
        state = self._state.observe()
        return state.sensors[0], self._info(state)

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Drive for one control step. Raises `ValueError` for an action that is not two finite numbers."""
        self._state.check_open()
        if self._episode is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        self._state.drive(self._state.slots, [action])
        state = self._state.observe()
        success = bool(self._state.tracker.success[0])
        return state.sensors[0], float(success), success, False, self._info(state)

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """A picture `[H, W, 3]` uint8, or None without a render mode."""
        if self.render_mode is None:
            return None
        self._state.check_open()
        return self._state.engine.picture(0)

    def close(self) -> None:
        """Free the engine. A second call does nothing."""
        self._state.engine.close()

    def _info(self, state: State) -> dict[str, Any]:
        return {
            name: column[0] if column.ndim > 1 else column[0].item() for name, column in self._state.info(state).items()
        }


class CorralEscapeVectorEnv(VectorEnv[NDArray[Any], NDArray[Any], NDArray[Any]]):
    """`num_envs` independent copies of `CorralEscapeEnv`, each with the same bits as a single one.

    Autoreset mode `NEXT_STEP`: the step after the last one of an episode ignores that row's action and returns the
    first observation of its next episode, with reward 0. With `reset(seed=s)`, environment `i` plays the episodes
    `i`, `i + num_envs`, `i + 2 * num_envs`, ... of seed `s`. `info` holds the same entries as arrays. The other
    arguments are the same; `max_episode_steps` truncates episodes.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": CONTROL_HZ,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

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
    ) -> None:
        _check_render_mode(render_mode)
        num_envs = whole_number("num_envs", num_envs, 1)
        max_episode_steps = whole_number("max_episode_steps", max_episode_steps, 1)
        self.num_envs = num_envs
        self.render_mode = render_mode
        self._state = _EnvState(num_envs, arena, body, dwell, engine, task)
        self.single_observation_space = _box(self._state.task.sensors)
        self.single_action_space = _box(ACTUATORS)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._max_episode_steps = max_episode_steps
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
        """Drive each robot for one control step; a robot whose episode is over begins its next one."""
        self._state.check_open()
        if not self._ready:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        commands = check_commands(actions, self.num_envs)
        driven, over = np.flatnonzero(~self._over), np.flatnonzero(self._over)
        if driven.size:
            self._state.drive(driven, commands[driven])
        if over.size:
            self._state.reset(over, self._state.episodes[over] + self.num_envs)
        state = self._state.observe()
        terminated = self._state.tracker.success.copy()
        truncated = ~terminated & (self._state.tracker.clock >= self._max_episode_steps)
        self._over = terminated | truncated
        return state.sensors, terminated.astype(np.float64), terminated, truncated, self._state.info(state)

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """One picture `[H, W, 3]` per environment, or None without a render mode."""
        if self.render_mode is None:
            return None
        self._state.check_open()
        return tuple(self._state.engine.picture(slot) for slot in range(self.num_envs))

    def close_extras(self, **_: Any) -> None:
        """Free the engine."""
        self._state.engine.close()


def register() -> None:
    """Register `CorralEscape-v0` unless it is registered already."""
    if "CorralEscape-v0" not in gymnasium.registry:
        gymnasium.register(
            id="CorralEscape-v0",
            entry_point="sim.env:CorralEscapeEnv",
            vector_entry_point="sim.env:CorralEscapeVectorEnv",
            max_episode_steps=MAX_STEPS,
        )
