"""The control steps of the starts that the page shows, as a data frame, and the recall of a program at each of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

import sim
from behaviours import Behaviour, Policy
from experiments.corral.command_map import kinds
from sim.teachers.escape import TEACHER_COMMANDS
from sim.tracker import DWELL_SECONDS

SHOWN = 12
"""Starts drawn for each controller; more hide each other."""

SENSORS = [sensor.name for sensor in sim.SENSORS]
MOTORS = [actuator.name for actuator in sim.ACTUATORS]


@torch.no_grad()
def control_steps(
    rollout: sim.Rollout, episodes: Sequence[int], program: Behaviour | Policy | None = None
) -> pd.DataFrame:
    """The control steps of some episodes, with what the program answers at each: similarity, margin, and so on.

    The margin is NaN where the program knows one result only; `speaker` is the behaviour that answered, for a policy
    that combines several.
    """
    path = rollout.trajectory.rows(np.isin(rollout.step_episode, episodes))
    frame = pd.DataFrame({"episode": np.repeat(rollout.episode, np.diff(rollout.offsets))})
    frame = frame.loc[np.isin(rollout.step_episode, episodes)].reset_index(drop=True)
    for name in ("step", "x", "y", "heading", "contact", "at_lamp", "reached"):
        frame[name] = getattr(path, name)
    frame[SENSORS], frame[MOTORS] = path.sensors, path.commands
    if program is not None:
        recall = program(path.sensors)
        margin = recall.margin.numpy().astype(np.float64)
        frame["similarity"] = recall.similarity.numpy().astype(np.float64)
        frame["margin"] = np.where(np.isfinite(margin), margin, np.nan)
        frame["familiarity"] = recall.familiarity.numpy().astype(np.float64)
        if recall.speaker is not None and isinstance(program, Policy):
            frame["speaker"] = np.array(program.names)[recall.speaker.numpy()]
    return frame


def timeline(steps: pd.DataFrame, episode: int) -> pd.DataFrame:
    """One episode: its control steps, `seconds` since the start, the teacher's `rule`, and whether the command
    `differs` from the teacher's."""
    frame = steps.loc[steps.episode == episode].reset_index(drop=True)
    rule = sim.Teacher().rule(frame[SENSORS].to_numpy())
    given = kinds(np.clip(frame[MOTORS].to_numpy(), -1, 1))
    return frame.assign(seconds=frame.step / sim.CONTROL_HZ, rule=rule, differs=given != kinds(TEACHER_COMMANDS)[rule])


def as_rollout(steps: pd.DataFrame, episodes: pd.DataFrame, arena: sim.Arena, seed: int, seconds: float) -> sim.Rollout:
    """Control steps and the records of their episodes as a rollout again, to be drawn."""
    episodes = episodes.loc[episodes.episode.isin(steps.episode)]
    columns = {name: steps[name].to_numpy() for name in ("step", "x", "y", "heading", "contact", "at_lamp", "reached")}
    trajectory = sim.Steps(
        sensors=steps[SENSORS].to_numpy(np.float64), commands=steps[MOTORS].to_numpy(np.float64), **columns
    )
    count = episodes.steps.to_numpy(np.int64)
    return sim.Rollout(
        arena=arena,
        body=episodes.body.iloc[0],
        seed=seed,
        seconds=seconds,
        dwell_seconds=DWELL_SECONDS,
        episode=episodes.episode.to_numpy(np.int64),
        success=episodes.success.to_numpy(bool),
        escaped=episodes.escaped.to_numpy(bool),
        time_to_light=episodes.time_to_light_s.to_numpy(np.float64),
        steps=count,
        dwell=episodes.dwell_fraction.to_numpy(np.float64),
        collisions=episodes.collision_fraction.to_numpy(np.float64),
        start=episodes[["start_x", "start_y", "start_heading"]].to_numpy(np.float64),
        trajectory=trajectory,
        offsets=np.concatenate([[0], np.cumsum(count)]),
    )


def behaviours_called(rollout: sim.Rollout) -> NDArray[np.int64]:
    """For each episode, how many behaviours the teacher's rules ask for."""
    rule = sim.Teacher().rule(rollout.trajectory.sensors)
    called = [np.logical_or.reduceat(np.isin(rule, rules), rollout.offsets[:-1]) for rules in sim.BEHAVIOURS.values()]
    return np.sum(called, axis=0)


def representative_episode(episodes: pd.DataFrame, names: Sequence[str]) -> int | None:
    """Of the starts that are kept, the one that shows most: successful, and with all behaviours, for these controllers.

    Among equals, the one whose duration with the last controller is the median. None without controllers.
    """
    if not names:
        return None
    drawn = episodes[episodes.controller.isin(names)]
    drawn = drawn.assign(merit=drawn.behaviours_called + 3 * drawn.success.astype(int))
    number = drawn.groupby("episode").controller.nunique()
    merit = drawn.groupby("episode").merit.sum()[number == len(names)].sort_index().iloc[:SHOWN]
    if merit.empty:
        return None
    last = drawn[drawn.controller == names[-1]].set_index("episode").steps
    best = sorted(merit.index[merit == merit.max()], key=lambda episode: (last[episode], episode))
    return int(best[(len(best) - 1) // 2])
