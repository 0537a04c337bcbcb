"""Files for the Rerun viewer: what its own reader finds there is what was driven and answered."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rerun.chunk import RrdReader
from small_run import small_run

import sim
from behaviours import BehaviourBank, OneShot, Priority, Space
from experiments.corral.trajectories import control_steps, with_recall
from experiments.main import main
from experiments.tasks import corral
from experiments.tasks.rrd import write_rrd


def read(path: Path) -> dict[str, pd.DataFrame]:
    """The columns of every entity of the one recording, its static ones without times."""
    reader = RrdReader(path)
    assert len(reader.recordings()) == 1
    found: dict[str, list[pd.DataFrame]] = {}
    for chunk in reader.stream().to_chunks():
        frame = chunk.to_record_batch().to_pandas().drop(columns="rerun.controls.RowId")
        found.setdefault(chunk.entity_path, []).append(frame)
    return {entity: pd.concat(frames, ignore_index=True) for entity, frames in found.items()}


def values(frame: pd.DataFrame, column: str) -> np.ndarray[Any, Any]:
    """One value per row of a column, in which Rerun keeps a list per row."""
    return np.array([row[0] for row in frame[column]])


def seconds(frame: pd.DataFrame) -> np.ndarray[Any, Any]:
    return frame["time"].dt.total_seconds().to_numpy()


@pytest.fixture(scope="module")
def policy() -> Priority:
    shown, _ = corral.shown_in(sim.rollout(sim.Teacher(), episodes=range(1_000_000, 1_000_006), seconds=20))
    bank = BehaviourBank(Space(corral.schema(), seed=1))
    for name, samples in corral.by_behaviour(shown).items():
        bank.learn(name, samples, OneShot())
    return Priority(bank, list(sim.BEHAVIOURS))


def test_a_file_holds_what_was_driven_answered_and_who_spoke(policy: Priority, tmp_path: Path) -> None:
    rollout = sim.rollout(policy, episodes=[3], seconds=20)
    drives = {"mine / 1": with_recall(control_steps(rollout), policy)}
    path = rollout.trajectory
    found = read(write_rrd(tmp_path / "drive.rrd", drives, rollout.arena))

    name = r"mine\ \/\ 1"
    pose = found[f"/world/robots/{name}"]
    place = np.stack(values(pose, "Transform3D:translation").tolist())
    assert np.allclose(place, np.stack([path.x, path.y, 0 * path.x], 1), atol=1e-6)
    x, y, z, w = np.stack(values(pose, "Transform3D:quaternion").tolist()).T
    assert np.allclose(x, 0)
    assert np.allclose(y, 0)
    assert np.allclose(np.cos(2 * np.arctan2(z, w) - path.heading), 1, atol=1e-9)

    columns = [("readings", sensor.name, path.sensors[:, row]) for row, sensor in enumerate(sim.SENSORS)]
    columns += [("commands", motor.name, path.commands[:, row]) for row, motor in enumerate(sim.ACTUATORS)]
    for kind, column, wanted in columns:
        frame = found[f"/{kind}/{name}/{column}"]
        assert np.array_equal(values(frame, "Scalars:scalars"), wanted)
        assert np.array_equal(frame["step"], np.arange(len(path)))
        assert np.allclose(seconds(frame), np.arange(len(path)) / 20)

    recall = policy(path.sensors)
    assert recall.speaker is not None
    for column in ("similarity", "familiarity"):
        written = values(found[f"/{column}/{name}"], "Scalars:scalars")
        assert np.array_equal(written, getattr(recall, column).double().numpy())
    turns = found[f"/speaker/{name}"]
    place_of_turn = np.searchsorted(turns["step"], np.arange(len(path)), side="right") - 1
    spoken = values(turns, "StateChange:state")
    assert spoken[place_of_turn].tolist() == [policy.names[index] for index in recall.speaker]
    assert len(set(spoken)) > 1
    assert (spoken[1:] != spoken[:-1]).all()


def test_the_arena_is_drawn_to_scale(tmp_path: Path) -> None:
    arena = sim.find_arena("clutter")
    rollout = sim.rollout(sim.Teacher(), arena, episodes=[0], seconds=1)
    found = read(write_rrd(tmp_path / "clutter.rrd", {"teacher": control_steps(rollout)}, arena))
    boxes, round_ones = found["/world/arena/boxes"], found["/world/arena/pillars"]
    drawn = [tuple(at[:2]) + tuple(half[:2]) for at, half in zip(*(boxes.iloc[0][:2]), strict=True)]
    shapes = [(box.x, box.y, box.half_x, box.half_y) for box in arena.obstacles if isinstance(box, sim.Box)]
    assert np.allclose(drawn, shapes)
    pillars = [pillar for pillar in arena.obstacles if isinstance(pillar, sim.Pillar)]
    assert np.allclose(round_ones["Cylinders3D:radii"].iloc[0], [pillar.radius for pillar in pillars])
    assert len(found["/world/arena/lamps"]["Cylinders3D:centers"].iloc[0]) == len(arena.lamps)
    assert not any(path.startswith(("/speaker", "/familiarity")) for path in found)


def without(column: str) -> Callable[[pd.DataFrame], dict[str, pd.DataFrame]]:
    return lambda steps: {"mine": steps.drop(columns=column)}


@pytest.mark.parametrize(
    ("drives", "said"),
    [
        (lambda steps: {}, "there is no drive to write"),
        (without("distance"), "the drive 'mine' lacks the columns distance"),
        (lambda steps: {"mine": steps}, "the steps of the drive 'mine' do not increase"),
        (lambda steps: {"mine": steps.iloc[:0]}, "expected those of one episode"),
    ],
)
def test_what_is_no_drive_is_refused(
    drives: Callable[[pd.DataFrame], dict[str, pd.DataFrame]], said: str, tmp_path: Path
) -> None:
    two = sim.rollout(sim.Teacher(), episodes=range(2), seconds=1)
    with pytest.raises(ValueError, match=said):
        write_rrd(tmp_path / "drive.rrd", drives(control_steps(two)), two.arena)
    assert not list(tmp_path.iterdir())


def test_without_rerun_or_with_it_turned_off_one_line_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rollout = sim.rollout(sim.Teacher(), episodes=[0], seconds=1)
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(ValueError, match="RERUN=off"):
        write_rrd(tmp_path / "drive.rrd", {"teacher": control_steps(rollout)}, rollout.arena)
    monkeypatch.delitem(sys.modules, "rerun")
    monkeypatch.setattr(sys, "path", [])
    with pytest.raises(ValueError, match=r"pip install 'torchvsa\[rerun\]'"):
        write_rrd(tmp_path / "drive.rrd", {"teacher": control_steps(rollout)}, rollout.arena)


def test_the_command_writes_a_file_for_each_start_of_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    few = ("starts=2", "other_starts=1", "wheeled_starts=1", "seconds=5", "demonstrations=3")
    outcome = small_run(tmp_path / "run", "controllers=[teacher,bundled,random]", "animate=false", *few)
    main(["rrd", str(outcome.folder)])
    files = [outcome.folder / "rrd" / f"start_{start}.rrd" for start in range(2)]
    assert capsys.readouterr().out.split() == list(map(str, files))
    both, one = map(read, files)
    assert {path for path in both if path.startswith("/world/robots/") and path.count("/") == 3} == {
        "/world/robots/teacher",
        "/world/robots/bundled",
        "/world/robots/random",
    }
    assert "/world/robots/random" not in one
    kept = pd.read_parquet(outcome.folder / "trajectories" / "bundled.parquet")
    kept = kept.loc[kept.episode == 1]
    assert np.array_equal(values(one["/familiarity/bundled"], "Scalars:scalars"), kept.familiarity)
    assert values(one["/speaker/bundled"], "StateChange:state")[0] == kept.speaker.iloc[0]
    with pytest.raises(SystemExit):
        main(["rrd", str(outcome.folder), "9"])
    assert capsys.readouterr().err.endswith("kept no start 9; choose from 0, 1\n")
