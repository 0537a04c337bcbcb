"""The corral as a task: its settings, what a learner is told about the robot, and runs of its teacher."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from rich.progress import Progress

import sim
from behaviours import Actuator, Behaviour, BehaviourBank, Demonstrations, OneShot, Schema, Sensor, Space
from behaviours.controller import Controller
from experiments.kit import Part, Settings, part, parts, setting
from experiments.kit.intervals import proportion
from experiments.kit.options import GROUPS, Group
from experiments.kit.pool import processes
from experiments.tasks.asked_once import AskedOnce
from experiments.tasks.behaviours import Precedence
from sim.engines import find_engine

COMMAND_LEVELS = 3
"""Levels that a learner tells apart on each wheel: backward, stop, forward."""

FIRST_DEMONSTRATION = 1_000_000
FIRST_VALIDATION = 2_000_000
"""Held-out starts are the episodes 0, 1, ...; those to learn from and to choose settings with lie far away."""


def episodes(default: Any, about: str, low: int = 1, **options: Any) -> Any:
    """A setting with a number of episodes of one kind, which are not as many as to be of the next kind, too."""
    return setting(default, about, low=low, high=FIRST_DEMONSTRATION, **options)


GROUPS["arena"] = Group(
    sim.ARENAS,
    given=frozenset({"within"}),
    only=lambda made: one_light(made()),
    meanings={
        "side": "inner edge length of the corral, m",
        "gap": "width of an opening, m",
        "gap_offset": "y of the opening's middle, m",
        "apart": "distance between the middles of the two openings, m",
        "lamp_beyond": "distance from the wall with the gap to the lamp, m",
        "lamp_offset": "y of the lamp relative to the opening's middle, m",
        "lamp_radius": "m",
        "layout": "number from which the obstacles are drawn",
        "start_margin": "smallest distance from a start to a wall, m",
        "wheel_noise": "standard deviation of a wheel's speed, as a share of the commanded speed",
    },
)


@dataclass
class Driving(Settings):
    """How robots are driven."""

    engine: str = setting("vector", "what moves the robots: bullet is the truth, vector is fast", choices=sim.ENGINES)
    body: str = setting("planar", "the robot's body; wheeled in bullet only", choices=sim.BODIES)
    seconds: float = setting(60.0, "longest duration of an episode, s", low=1 / sim.CONTROL_HZ)
    robots: int | None = setting(
        None, "robots per process at once; null for 4,096, and for 64 in bullet, where each has 29 MB", low=1
    )


@dataclass
class Learning(Driving):
    """What a program is made with."""

    vsa: Part = part("vsa", "map_c", "the architecture")
    encoder: Part = part("encoder", "level", "the code of one reading")
    record: Part = part("record", "product", "how the codes of all sensors become a condition")
    protection: Part = part("protection", "none", "what is done to a condition before it is bound")
    rule: Part = part("rule", "error_driven", "how a program is learned")


@dataclass
class InOneArena(Learning):
    """The same, for a study that knows one arena."""

    arena: Part = part("arena", "default", "the corral")


@dataclass
class Printed:
    """The paper's codes, and its rule with a raw accumulator."""

    encoder: Part = part("encoder", "lookup", "the code of one reading")
    record: Part = part("record", "sum", "how the codes of all sensors become a condition")
    protection: Part = part("protection", "self_shift", "what is done to a condition before it is bound")
    rule: Part = part("rule", "one_shot", "how a program is learned")


@dataclass
class Paper(Printed):
    """The printed algorithms, read literally."""

    encoder: Part = part("encoder", "lookup", "the code of one reading; its bins are those of the run's encoder")
    rule: Part = part("rule", "literal", "how a program is learned")


def schema(out_of_range: Literal["error", "clip"] = "clip", sensors: Sequence[sim.Channel] = sim.SENSORS) -> Schema:
    """The corral robot's sensors, or those of another task, and its actuators.

    Live readings outside a range are clipped, unless told otherwise.
    """
    return Schema(
        [Sensor(channel.name, channel.low, channel.high, channel.unit, out_of_range) for channel in sensors],
        [
            Actuator(channel.name, channel.low, channel.high, channel.unit, levels=COMMAND_LEVELS)
            for channel in sim.ACTUATORS
        ],
    )


def space(settings: Learning, bins: int | None = None) -> Space:
    """Codebooks for the groups `vsa`, `encoder`, `record` and `protection`; `bins` replaces those of the encoder."""
    encoder = settings.encoder if bins is None else {**settings.encoder, "bins": bins}
    return parts.space(schema(), settings.vsa, encoder, settings.record, settings.protection, settings.seed)


def check_driving(settings: Driving, *engines: str) -> None:
    """Raise for an engine of the run, or one of these, that is not installed, or does not have the body."""
    for engine in dict.fromkeys((settings.engine, *engines)):
        if engine == "bullet" and find_spec("pybullet") is None:
            raise ValueError(
                "engine=bullet needs pybullet, which is there for Python 3.11 only: pip install 'torchvsa[sim]'"
            )
        if settings.body not in find_engine(engine).bodies:
            raise ValueError(f"body={settings.body}: engine={engine} does not have it; choose engine=bullet")


def check_learning(settings: Learning) -> Space:
    """The codebooks of the run. Raises unless its rule can train programs over them."""
    found = space(settings)
    parts.refuse_unsupported(parts.rule(settings.rule), found)
    return found


def check_policy(space: Space, composition: parts.Options) -> None:
    """Raise for options of a policy that it does not take, over the teacher's behaviours."""
    bank = BehaviourBank(space)
    for name in sim.BEHAVIOURS:
        bank.learn(name, Demonstrations([[0.0, 0.0, 0.0]], [[1.0, 1.0]]), OneShot())
    parts.policy(bank, composition)


def arena(options: parts.Options) -> sim.Arena:
    """The arena of the group `arena`."""
    made = sim.ARENAS.get(options["name"])
    if made is None:
        raise ValueError(f"there is no arena {options['name']!r}; choose from {', '.join(arenas())}")
    parts.known_only("arena", options, made)
    found = made(**{key: value for key, value in options.items() if key != "name"})
    if not one_light(found):
        known = ", ".join(arenas())
        raise ValueError(f"arena={options['name']}: the robot of this study senses one light; choose from {known}")
    return found


def one_light(arena: sim.Arena) -> bool:
    """Whether a robot that senses one light can drive there."""
    return sim.Task.of(arena) == sim.Task()


def arenas() -> list[str]:
    """The names of the arenas with one light."""
    return [name for name in sim.ARENAS if one_light(sim.find_arena(name))]


def frozen(policy: sim.ControllerLike) -> sim.ControllerLike:
    """The form in which a policy is asked: frozen, if it is a behaviour whose program holds integers.

    The frozen form of such a behaviour gives the same bits, and is faster.
    """
    if isinstance(policy, Behaviour) and not (policy.program.is_floating_point() or policy.program.is_complex()):
        return policy.freeze()
    return policy


def driving(policy: sim.ControllerLike) -> sim.ControllerLike:
    """What drives in place of a policy: its answers, each asked once in the `frozen` form, where that is possible."""
    fastest = frozen(policy)
    return AskedOnce(fastest) if isinstance(fastest, Controller) and AskedOnce.possible(fastest) else fastest


def drive(
    settings: Driving,
    policy: sim.ControllerLike,
    episodes: Iterable[int],
    arena: str | sim.Arena = "default",
    record: bool = False,
) -> sim.Rollout:
    """Drive in this process, as a cell does."""
    return sim.rollout(
        driving(policy), arena, settings.body, episodes, settings.seed, settings.seconds, robots=settings.robots,
        record=record, engine=settings.engine,
    )  # fmt: skip


def drive_together(
    settings: Driving,
    what: str,
    policy: sim.ControllerLike,
    episodes: range,
    progress: Progress,
    arena: str | sim.Arena = "default",
) -> sim.Rollout:
    """Drive on all workers, recorded, with a progress bar: the same bits as in one process.

    The engine `vector` drives in this process, in less time than others take to start.
    """
    task = progress.add_task(what, total=len(episodes))
    with processes(1 if settings.engine == "vector" else settings.workers) as executor:
        return sim.rollout(
            policy, arena, settings.body, episodes, settings.seed, settings.seconds, robots=settings.robots,
            executor=executor, workers=1 if executor is None else settings.workers, engine=settings.engine,
            progress=lambda count: progress.advance(task, count),
        )  # fmt: skip


def shown_in(rollout: sim.Rollout) -> tuple[Demonstrations, NDArray[np.bool_]]:
    """The control steps of a recorded rollout as a demonstration, and which of them came before the lamp."""
    steps = rollout.trajectory
    return Demonstrations(steps.sensors, steps.commands, rollout.step_episode), ~steps.reached


def moving(rollout: sim.Rollout) -> Demonstrations:
    """The control steps before the lamp: a robot at rest repeats one condition and would flatter every learner."""
    shown, before = shown_in(rollout)
    return shown.where(before)


def by_behaviour(shown: Demonstrations) -> dict[str, Demonstrations]:
    """The samples of each of the teacher's behaviours, those in which its rules fire.

    Raises `ValueError` for a behaviour without any.
    """
    return Precedence(list(sim.BEHAVIOURS)).apart(shown)


def from_file(path: str | Path) -> Demonstrations:
    """Demonstrations that were saved with `Demonstrations.save`; raises unless they fit the corral robot."""
    try:
        demonstrations = Demonstrations.load(path)
        demonstrations.check(schema(out_of_range="error"))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    return demonstrations


def driven(rollout: sim.Rollout) -> dict[str, Any]:
    """Numbers of a rollout that can be pooled: `episodes`, `successes` and `escapes`."""
    return {
        "episodes": len(rollout),
        "successes": int(rollout.success.sum()),
        "escapes": int(rollout.escaped.sum()),
    }


def success(episodes: int, successes: int) -> dict[str, Any]:
    """Success over all episodes with Wilson's 95 % interval, as columns of a row; None for no episode."""
    return {"episodes": int(episodes), **proportion("success", int(successes), int(episodes))}
