"""A rollout as data frames, a row per control step and a row per episode; and back, to be drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import torch

import sim
from behaviours import Behaviour, Policy
from experiments.corral.command_map import COMMANDS, kinds
from experiments.tasks import corral
from experiments.tasks.recorded import SENSORS, frame_of, steps_of
from sim.teachers.escape import TEACHER_COMMANDS
from sim.tracker import DWELL_SECONDS

if TYPE_CHECKING:
    from experiments.corral.settings import Corral

SHOWN = 12
"""Starts kept for each controller; more trajectories hide each other."""

EPISODE = {
    "episode": "episode",
    "success": "success",
    "escaped": "escaped",
    "time_to_light": "time_to_light_s",
    "steps": "steps",
    "dwell": "dwell_fraction",
    "collisions": "collision_fraction",
}
"""What a rollout knows of each episode, and its name in the records."""
START = ["start_x", "start_y", "start_heading"]
PLACES = ("never left the corral", "left it, not at the lamp", "at the lamp, not long enough")
"""Where a robot that did not succeed is at the end."""


def control_steps(rollout: sim.Rollout) -> pd.DataFrame:
    """A row per control step: what was recorded, and what the teacher would have done.

    `rule` is the index of the teacher's rule that fires, `command` and `wanted` are the command given and the
    teacher's as indices into `command_map.COMMANDS`, and `differs` tells whether they are different.
    """
    path = rollout.trajectory
    frame = frame_of(path)
    frame.insert(0, "episode", rollout.step_episode)
    frame["seconds"] = frame.step / sim.CONTROL_HZ
    frame["rule"] = sim.Teacher().rule(path.sensors)
    frame["command"] = kinds(np.clip(path.commands, -1, 1))
    frame["wanted"] = kinds(TEACHER_COMMANDS)[frame["rule"]]
    return frame.assign(differs=frame.command != frame.wanted)


@torch.no_grad()
def with_recall(steps: pd.DataFrame, program: Behaviour | Policy) -> pd.DataFrame:
    """Control steps with what a program answers at each: `similarity`, `margin` and `familiarity`.

    The margin is NaN where the program knows one result only. `speaker` is the behaviour that answers, for a policy
    that combines several.
    """
    recall = program(steps[SENSORS].to_numpy())
    found = {name: getattr(recall, name).double().numpy() for name in ("similarity", "margin", "familiarity")}
    steps = steps.assign(**found).replace({"margin": {np.inf: np.nan}})
    if recall.speaker is not None and isinstance(program, Policy):
        steps["speaker"] = np.array(program.names)[recall.speaker.numpy()]
    return steps


def episodes_of(rollout: sim.Rollout, steps: pd.DataFrame) -> pd.DataFrame:
    """A row per episode of a rollout with these control steps.

    `end` is one of `PLACES`, and None after success. `steps_unlike_teacher` counts the steps with another command,
    `behaviours_called` the behaviours that the teacher's rules ask for.
    """
    behaviour = {rule: name for name, rules in sim.BEHAVIOURS.items() for rule in rules}
    groups = steps.assign(behaviour=steps["rule"].map(behaviour.get)).groupby("episode", sort=False)
    frame = pd.DataFrame({name: getattr(rollout, column) for column, name in EPISODE.items()})
    frame[START] = rollout.start
    place = np.select([rollout.success, groups.at_lamp.last(), rollout.escaped], [3, 2, 1], 0)
    return frame.assign(
        engine=rollout.engine,
        body=rollout.body,
        end=np.array([*PLACES, None])[place],
        steps_unlike_teacher=groups.differs.sum().to_numpy(),
        behaviours_called=groups.behaviour.nunique().to_numpy(),
    )


def mistakes(steps: pd.DataFrame) -> list[dict[str, Any]]:
    """The commands that are not the teacher's in control steps of failing episodes, the most frequent first.

    Each row has the teacher's `rule`, the `command` given instead, its `share` of all these control steps, and the
    median readings.
    """
    groups = steps.loc[steps.differs].groupby(["rule", "command"])
    rows = groups[SENSORS].median().assign(share=groups.size() / len(steps)).reset_index()
    rows["rule"] = [sim.TEACHER_RULES[rule] for rule in rows["rule"]]
    rows["command"] = [COMMANDS[command] for command in rows.command]
    return rows.sort_values("share", ascending=False, kind="stable").to_dict(orient="records")


def driven_episodes(records: pd.DataFrame) -> pd.DataFrame:
    """All episodes of a study's records, with the types that columns lose in a frame with rows of other kinds."""
    whole = dict.fromkeys(("episode", "steps", "steps_unlike_teacher", "behaviours_called"), int)
    return records.loc[records.kind == "episode"].astype({**whole, "success": bool, "escaped": bool})


def as_rollout(steps: pd.DataFrame, episodes: pd.DataFrame, settings: Corral) -> sim.Rollout:
    """Control steps, and the rows of their episodes, as a rollout again."""
    episodes = episodes.loc[episodes.episode.isin(steps.episode)]
    columns = {column: episodes[name].to_numpy() for column, name in EPISODE.items()}
    return sim.Rollout(
        arena=corral.arena(settings.arena),
        task=sim.Task(),
        engine=episodes.engine.iloc[0],
        body=episodes.body.iloc[0],
        seed=settings.seed,
        seconds=settings.seconds,
        dwell_seconds=DWELL_SECONDS,
        start=episodes[START].to_numpy(),
        trajectory=steps_of(steps),
        offsets=np.concatenate([[0], np.cumsum(columns["steps"])]),
        **columns,
    )


def representative_episode(episodes: pd.DataFrame, names: Sequence[str]) -> int | None:
    """Of the kept starts, the one that shows most: successful, and with all behaviours, for these controllers.

    Among equals, the one of median duration. None without controllers, or if they drove no start in common.
    """
    starts = episodes.loc[episodes.controller.isin(names)].groupby("episode")
    common = starts[["success", "behaviours_called", "steps"]].sum().loc[starts.size() == len(names)].iloc[:SHOWN]
    if common.empty:
        return None
    merit = 3 * common.success + common.behaviours_called
    best = common.loc[merit == merit.max()].sort_values("steps", kind="stable")
    return int(best.index[(len(best) - 1) // 2])
