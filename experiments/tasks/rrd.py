"""Recorded drives as a file for the Rerun viewer (the extra `rerun`): poses, readings, commands, who speaks."""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

import sim
from behaviours.storage import write_atomically
from experiments.tasks.recorded import MOTORS, ONE_LIGHT, STEP
from sim.robot import RADIUS

if TYPE_CHECKING:
    import rerun

CERTAINTY = ("similarity", "margin", "familiarity")
"""Columns that are written if a drive has them, as a program's answers do; so is the column `speaker`."""
WALL, LAMP, ROBOT = 0.25, 0.1, 0.08
"""Heights in the picture, m."""
COLOURS = {"yellow": (240, 228, 66), "blue": (0, 114, 178)}
"""Of lamps; others are white."""


def write_rrd(
    path: str | Path, drives: Mapping[str, pd.DataFrame], arena: sim.Arena, task: sim.Task = ONE_LIGHT
) -> Path:
    """Write one episode of one or several controllers, to be looked at side by side with `rerun FILE`.

    The file holds one recording with the timelines `step` and `time` (s). The entities of the controller `name` are
    `world/robots/name` (its pose; m), `readings/name/<sensor>` and `commands/name/<motor>`, and where the drive has
    such columns `similarity/name`, `margin/name`, `familiarity/name` and `speaker/name` (the behaviour that answers,
    at each step where that changes). No viewer is started.

    Args:
        path: of the file, which is written whole or not at all.
        drives: by the name of the controller, its control steps: columns as of `recorded.frame_of`, one row per step.
            `corral.trajectories.with_recall` adds what a program answers.
        arena: where they drove.
        task: what their robots sense.

    Raises:
        ValueError: without rerun-sdk, or with `RERUN=off` in the environment; without drives; for a drive that lacks a
            column, is empty, or whose steps do not increase, as those of several episodes.
        OSError: if the file cannot be written.
    """
    if find_spec("rerun") is None:
        raise ValueError("files for Rerun need rerun-sdk: pip install 'torchvsa[rerun]'")
    sensors = [sensor.name for sensor in task.sensors]
    _check(drives, [*STEP, *sensors, *MOTORS])
    import rerun as rr

    # Of its own, since the viewer merges recordings with the same id.
    recording = rr.RecordingStream("torchvsa", recording_id=str(uuid.uuid4()))
    if not rr.is_enabled(recording):
        raise ValueError("the environment turns recording off (RERUN=off); unset RERUN to write files")
    stream = recording.memory_recording()
    recording.send_recording_name(Path(path).stem)
    recording.send_blueprint(_blueprint(list(drives)))
    _draw_arena(recording, arena)
    for name, steps in drives.items():
        _draw_robot(recording, name, steps)
        times = _times(steps)
        entities = [["readings", name, sensor] for sensor in sensors] + [["commands", name, motor] for motor in MOTORS]
        columns = [*sensors, *MOTORS, *(column for column in CERTAINTY if column in steps)]
        entities += [[column, name] for column in CERTAINTY if column in steps]
        for entity, column in zip(entities, columns, strict=True):
            scalars = rr.Scalars.columns(scalars=steps[column].to_numpy(dtype=float))
            recording.send_columns(rr.new_entity_path(entity), times, scalars)
        if "speaker" in steps:
            turns = steps.loc[steps.speaker != steps.speaker.shift()]
            states = rr.StateChange.columns(state=turns.speaker.tolist())
            recording.send_columns(rr.new_entity_path(["speaker", name]), _times(turns), states)
    return write_atomically(path, stream.drain_as_bytes())


def _check(drives: Mapping[str, pd.DataFrame], needed: list[str]) -> None:
    if not drives:
        raise ValueError("there is no drive to write; expected at least one")
    for name, steps in drives.items():
        lacks = [column for column in needed if column not in steps]
        if lacks:
            raise ValueError(f"the drive {name!r} lacks the columns {', '.join(lacks)}")
        if steps.empty or not (np.diff(steps.step) > 0).all():
            raise ValueError(f"the steps of the drive {name!r} do not increase; expected those of one episode")


def _times(steps: pd.DataFrame) -> list[rerun.TimeColumn]:
    import rerun as rr

    index = steps.step.to_numpy()
    return [rr.TimeColumn("step", sequence=index), rr.TimeColumn("time", duration=index / sim.CONTROL_HZ)]


def _draw_arena(recording: rerun.RecordingStream, arena: sim.Arena) -> None:
    import rerun as rr

    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    boxes = [box for box in arena.obstacles if isinstance(box, sim.Box)]
    pillars = [pillar for pillar in arena.obstacles if isinstance(pillar, sim.Pillar)]
    recording.log(
        "world/arena/boxes",
        rr.Boxes3D(
            centers=[(box.x, box.y, WALL / 2) for box in boxes],
            half_sizes=[(box.half_x, box.half_y, WALL / 2) for box in boxes],
        ),
        static=True,
    )
    for entity, shapes, height in (("pillars", pillars, WALL), ("lamps", arena.lamps, LAMP)):
        colours = [COLOURS.get(shape.colour, (255, 255, 255)) for shape in shapes if isinstance(shape, sim.Lamp)]
        recording.log(
            f"world/arena/{entity}",
            rr.Cylinders3D(
                centers=[(shape.x, shape.y, height / 2) for shape in shapes],
                radii=[shape.radius for shape in shapes],
                lengths=[height] * len(shapes),
                colors=colours or None,
                fill_mode="solid",
            ),
            static=True,
        )


def _draw_robot(recording: rerun.RecordingStream, name: str, steps: pd.DataFrame) -> None:
    import rerun as rr

    entity = rr.new_entity_path(["world", "robots", name])
    place = np.stack([steps.x, steps.y, np.zeros(len(steps))], axis=1)
    half, zeros = steps.heading.to_numpy() / 2, np.zeros(len(steps))
    turned = np.stack([zeros, zeros, np.sin(half), np.cos(half)], axis=1)
    recording.send_columns(entity, _times(steps), rr.Transform3D.columns(translation=place, quaternion=turned))
    body = rr.Cylinders3D(centers=[(0, 0, ROBOT / 2)], radii=[RADIUS], lengths=[ROBOT], labels=[name])
    recording.log(f"{entity}/body", body, static=True)
    recording.log(f"{entity}/front", rr.Arrows3D(vectors=[(RADIUS, 0, 0)], origins=[(0, 0, ROBOT)]), static=True)


def _blueprint(names: list[str]) -> rerun.blueprint.Blueprint:
    import rerun as rr
    import rerun.blueprint as rrb

    def of_each(kind: str) -> rrb.Tabs:
        return rrb.Tabs(
            *[rrb.TimeSeriesView(origin=rr.new_entity_path([kind, name]), name=f"{name}: {kind}") for name in names]
        )

    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(origin="world", name="arena"),
            rrb.Vertical(
                rrb.StateTimelineView(origin="speaker", name="who speaks"),
                rrb.TimeSeriesView(origin="familiarity", name="familiarity"),
                of_each("readings"),
                of_each("commands"),
            ),
        )
    )
