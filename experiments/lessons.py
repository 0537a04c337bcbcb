"""What the learners are shown: runs of the teacher, or a file of the user's own."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import sim
from behaviours import Demonstrations
from experiments import presets

FIRST_DEMONSTRATION = 1_000_000
FIRST_VALIDATION = 2_000_000
"""Held-out starts are the episodes 0, 1, ...; those to learn from and to choose settings with lie far away."""


def shown_in(rollout: sim.Rollout) -> tuple[Demonstrations, NDArray[np.bool_]]:
    """The control steps of a recorded rollout as a demonstration, and which of them came before the lamp."""
    steps = rollout.trajectory
    return Demonstrations(steps.sensors, steps.commands, rollout.step_episode), ~steps.reached


def from_file(path: str | Path) -> Demonstrations:
    """Demonstrations that were saved with `Demonstrations.save`; raises unless they fit the corral robot."""
    try:
        demonstrations = Demonstrations.load(path)
        demonstrations.check(presets.schema(out_of_range="error"))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    return demonstrations
