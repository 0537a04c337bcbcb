"""Recorded control steps of the corral as a data frame, a row per step, and back."""

from __future__ import annotations

from dataclasses import fields

import pandas as pd

import sim

SENSORS = [sensor.name for sensor in sim.SENSORS]
MOTORS = [actuator.name for actuator in sim.ACTUATORS]
STEP = [field.name for field in fields(sim.Steps) if field.name not in ("sensors", "commands")]


def frame_of(steps: sim.Steps) -> pd.DataFrame:
    """A column for each field of the steps, each sensor and each wheel."""
    frame = pd.DataFrame({name: getattr(steps, name) for name in STEP})
    frame[SENSORS], frame[MOTORS] = steps.sensors, steps.commands
    return frame


def steps_of(frame: pd.DataFrame) -> sim.Steps:
    """The steps of a frame that has at least the columns of `frame_of`."""
    return sim.Steps(
        sensors=frame[SENSORS].to_numpy(),
        commands=frame[MOTORS].to_numpy(),
        **{name: frame[name].to_numpy() for name in STEP},
    )
