"""The Gymnasium environment `CorralEscape-v0`, for one robot. `import sim` registers it."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from sim.arena import Arena
from sim.checks import whole_number
from sim.engine import State
from sim.env_state import MAX_STEPS, EnvState, Floats, box, check_render_mode
from sim.robot import ACTUATORS, CONTROL_HZ
from sim.task import Task
from sim.tracker import DWELL_SECONDS


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
        check_render_mode(render_mode)
        self.render_mode = render_mode
        self._state = EnvState(1, arena, body, dwell, engine, task)
        self.observation_space = box(self._state.task.sensors)
        self.action_space = box(ACTUATORS)
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


def register() -> None:
    """Register `CorralEscape-v0` unless it is registered already."""
    if "CorralEscape-v0" not in gymnasium.registry:
        gymnasium.register(
            id="CorralEscape-v0",
            entry_point="sim.env:CorralEscapeEnv",
            vector_entry_point="sim.vector_env:CorralEscapeVectorEnv",
            max_episode_steps=MAX_STEPS,
        )
