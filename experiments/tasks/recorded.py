"""Recorded control steps of the corral as a data frame, a row per step, and back."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, BinaryIO

import pandas as pd

import sim

SENSORS = [sensor.name for sensor in sim.SENSORS]
MOTORS = [actuator.name for actuator in sim.ACTUATORS]
STEP = [field.name for field in fields(sim.Steps) if field.name not in ("sensors", "commands")]

ONE_LIGHT = sim.Task()


def frame_of(steps: sim.Steps, task: sim.Task = ONE_LIGHT) -> pd.DataFrame:
    """A column for each field of the steps, each sensor of the task and each wheel."""
    frame = pd.DataFrame({name: getattr(steps, name) for name in STEP})
    frame[_sensors(task)], frame[MOTORS] = steps.sensors, steps.commands
    return frame


def _sensors(task: sim.Task) -> list[str]:
    return [sensor.name for sensor in task.sensors]


def steps_of(frame: pd.DataFrame, task: sim.Task = ONE_LIGHT) -> sim.Steps:
    """The steps of a frame that has at least the columns of `frame_of`."""
    return sim.Steps(
        sensors=frame[_sensors(task)].to_numpy(),
        commands=frame[MOTORS].to_numpy(),
        **{name: frame[name].to_numpy() for name in STEP},
    )


def animate(path: pd.DataFrame, title: str, arena: str, task: sim.Task, file: BinaryIO, **looks: Any) -> None:
    """Write a GIF of a frame of `frame_of` with the column `speaker`; `looks` as in `sim.render.animate_steps`."""
    from sim import render

    where = sim.find_arena(arena)
    render.animate_steps(steps_of(path, task), title, file, where, path.speaker.tolist(), task, **looks)
