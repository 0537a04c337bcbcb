"""LeRobotDataset folders, written by the specification of versions 2.1 and 3, are read with names, ranges, episodes."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from behaviours import Demonstrations, Schema
from behaviours.data import read, read_lerobot

LENGTHS = [4, 3, 5]
JOINTS = ["shoulder.pos", "elbow.pos"]
FEATURES: dict[str, Any] = {
    "observation.state": {"dtype": "float32", "shape": [2], "names": JOINTS},
    "observation.force": {"dtype": "float64", "shape": [3], "names": None},
    "observation.grasped": {"dtype": "bool", "shape": [1], "names": None},
    "observation.mode": {"dtype": "string", "shape": [1], "names": None},
    "observation.map": {"dtype": "float32", "shape": [4, 4], "names": None},
    "observation.images.top": {"dtype": "video", "shape": [48, 64, 3], "names": ["height", "width", "channel"]},
    "action": {"dtype": "float32", "shape": [2], "names": {"motors": JOINTS}},
    "next.reward": {"dtype": "float32", "shape": [1], "names": None},
    **{name: {"dtype": "int64", "shape": [1], "names": None} for name in ("episode_index", "frame_index", "index")},
    "task_index": {"dtype": "int64", "shape": [1], "names": None},
    "timestamp": {"dtype": "float32", "shape": [1], "names": None},
}


def rows_of(episode: int) -> dict[str, Any]:
    """The columns of an episode, as lists."""
    places = np.arange(LENGTHS[episode]) + 10 * episode
    return {
        "observation.state": np.stack([places / 8, -places], 1).tolist(),
        "observation.force": [None if place == 11 else [place, 0.5, place**2] for place in places.tolist()],
        "observation.grasped": (places % 2 == 1).tolist(),
        "observation.mode": ["near" if place % 3 else "far" for place in places],
        "observation.map": np.zeros((len(places), 4, 4)).tolist(),
        "action": np.stack([places % 4, places / 4], 1).tolist(),
        "next.reward": np.zeros(len(places)).tolist(),
        "episode_index": np.full(len(places), episode).tolist(),
        "frame_index": np.arange(len(places)).tolist(),
        "index": places.tolist(),
        "task_index": np.zeros(len(places), int).tolist(),
        "timestamp": (np.arange(len(places)) / 20).tolist(),
    }


SCHEMA = pa.schema(
    [
        ("observation.state", pa.list_(pa.float32(), 2)),
        ("observation.force", pa.list_(pa.float64())),
        ("observation.map", pa.list_(pa.list_(pa.float32()))),
        ("action", pa.list_(pa.float32())),
        ("episode_index", pa.int64()),
    ]
)


def write(path: Path, episodes: list[int]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    parts = [rows_of(episode) for episode in episodes]
    joined = {name: [row for part in parts for row in part[name]] for name in parts[0]}
    arrays = {
        name: pa.array(column, SCHEMA.field(name).type if name in SCHEMA.names else None)
        for name, column in joined.items()
    }
    parquet.write_table(pa.table(arrays), path)


def bounds(episodes: list[int], name: str) -> dict[str, list[float]]:
    """The statistics of a feature in these episodes."""
    rows = np.array([row for episode in episodes for row in rows_of(episode)[name] if row is not None], dtype=float)
    rows = rows.reshape(len(rows), -1)
    return {"min": rows.min(0).tolist(), "max": rows.max(0).tolist(), "mean": rows.mean(0).tolist()}


NUMERIC = ["observation.state", "observation.force", "action"]


def dataset(folder: Path, version: str, **changes: Any) -> Path:
    """A small data set of three episodes; in version 2.1 a file per episode, in version 3 several in one."""
    (folder / "meta").mkdir(parents=True)
    info = {"codebase_version": version, "fps": 20, "total_episodes": 3, "total_frames": 12, "features": FEATURES}
    (folder / "meta" / "info.json").write_text(json.dumps(info | changes))
    if version == "v2.1":
        for episode in range(3):
            write(folder / f"data/chunk-000/episode_{episode:06d}.parquet", [episode])
        lines = [{"episode_index": one, "stats": {name: bounds([one], name) for name in NUMERIC}} for one in range(3)]
        (folder / "meta" / "episodes_stats.jsonl").write_text("\n".join(map(json.dumps, lines)))
    else:
        write(folder / "data/chunk-000/file-000.parquet", [0, 1])
        write(folder / "data/chunk-000/file-001.parquet", [2])
        (folder / "meta" / "stats.json").write_text(json.dumps({name: bounds([0, 1, 2], name) for name in NUMERIC}))
    return folder


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_both_versions_are_read_alike(version: str, tmp_path: Path) -> None:
    log = read(dataset(tmp_path / "data set", version))
    forces = [f"observation.force[{place}]" for place in range(3)]
    sensors = ["observation.state.shoulder.pos", "observation.state.elbow.pos", *forces]
    sensors += ["observation.grasped", "observation.mode"]
    actuators = ["action.shoulder.pos", "action.elbow.pos"]
    assert (log.sensors, log.actuators, log.columns) == (sensors, actuators, sensors + actuators)
    assert log.rate == 20
    assert log.episodes is not None
    assert log.episodes.tolist() == [0] * 4 + [1] * 3 + [2] * 5
    places = np.concatenate([np.arange(length) + 10 * episode for episode, length in enumerate(LENGTHS)])
    expected = {
        "observation.state.elbow.pos": -places,
        "observation.force[2]": np.where(places == 11, np.nan, places**2),
        "observation.grasped": places % 2,
        "action.shoulder.pos": places % 4,
        "action.elbow.pos": places / 4,
    }
    for name, values in expected.items():
        assert np.array_equal(log[name].astype(float), values, equal_nan=True), name
    assert log["observation.mode"].tolist() == ["near" if place % 3 else "far" for place in places]
    assert log.ranges["observation.state.elbow.pos"] == (-24, 0)
    assert log.ranges["observation.force[2]"] == (0, 576)
    assert log.ranges["action.elbow.pos"] == (0, 6)
    assert "images are not read" in log.left_out["observation.images.top"]
    assert "[4, 4]" in log.left_out["observation.map"]
    counters = {"episode_index", "frame_index", "index", "timestamp", "task_index"}
    assert set(log.left_out) == counters | {"next.reward", "observation.map", "observation.images.top"}


def test_a_schema_has_the_ranges_and_demonstrations_the_episodes(tmp_path: Path) -> None:
    folder = dataset(tmp_path / "set", "v3.0")
    stats = json.loads((folder / "meta/stats.json").read_text())
    stats["observation.state"] = {"min": [-1, -50], "max": [4, 50]}
    (folder / "meta/stats.json").write_text(json.dumps(stats))
    log = read(folder)
    assert log.sensors is not None
    schema = Schema.from_data(log)
    names = [sensor.name for sensor in schema.sensors]
    assert names == [name for name in log.sensors if name != "observation.force[1]"]  # it is always 0.5
    assert [(sensor.low, sensor.high) for sensor in schema.sensors[:2]] == [(-1, 4), (-50, 50)]
    assert schema.actuators[0].levels == 4
    assert Demonstrations.from_data(log, schema).episodes.unique().tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (None, ["action[0]", "action[1]"]),
        (["x"], ["action[0]", "action[1]"]),
        (["x", "x"], ["action[0]", "action[1]"]),
        ({"dy": 1, "dx": 0}, ["action.dx", "action.dy"]),
        ({"arm": ["a"], "hand": ["b"]}, ["action.a", "action.b"]),
    ],
)
def test_names_in_every_form(names: Any, expected: list[str], tmp_path: Path) -> None:
    features = FEATURES | {"action": {"dtype": "float32", "shape": [2], "names": names}}
    assert read_lerobot(dataset(tmp_path / "set", "v2.1", features=features)).actuators == expected


def test_a_part_of_a_data_set_without_statistics(tmp_path: Path) -> None:
    folder = dataset(tmp_path / "set", "v2.1")
    (folder / "meta/episodes_stats.jsonl").unlink()
    (folder / "data/chunk-000/episode_000001.parquet").unlink()
    log = read(folder)
    assert log.episodes is not None
    assert log.episodes.tolist() == [0] * 4 + [2] * 5
    assert log.ranges == {}
    assert log.left_out["1 of 3 episodes"] == "their files are not in the folder"


def test_chunks_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    folder = dataset(tmp_path / "set", "v2.1")
    for episode, chunk in ((1, 999), (2, 1000)):
        (folder / f"data/chunk-{chunk}").mkdir()
        name = f"episode_{episode:06d}.parquet"
        (folder / "data/chunk-000" / name).rename(folder / f"data/chunk-{chunk}" / name)
    log = read(folder)
    assert log.episodes is not None
    assert np.unique(log.episodes, return_index=True)[1].tolist() == [0, 4, 7]
    assert (np.diff(log.episodes) >= 0).all()


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"codebase_version": "v1.6"}, "codebase_version is 'v1.6'; versions 2.0, 2.1 and 3 are read"),
        ({"features": [1]}, "features must map names to descriptions"),
        ({"features": {"observation.state": FEATURES["observation.state"]}}, "no numeric feature 'action'"),
        ({"features": FEATURES | {"action": {"dtype": "video", "shape": [2]}}}, "no numeric feature 'action'"),
        ({"features": FEATURES | {"action": {"dtype": "float32", "shape": [7]}}}, "rows of 2 numbers, not of 7"),
        ({"features": FEATURES | {"action.x": {"dtype": "float32", "shape": [1]}}}, "has no column 'action.x'"),
        (
            {"features": FEATURES | {"action.elbow.pos": {"dtype": "float32", "shape": [1]}}},
            "two features .* 'action.elbow.pos'",
        ),
        (
            {"features": FEATURES | {"observation.grasped": {"dtype": "float32", "shape": [2]}}},
            "'observation.grasped' holds bool, but meta/info.json says 2 numbers",
        ),
    ],
)
def test_mistakes_take_one_line(changes: dict[str, Any], why: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=why) as caught:
        read(dataset(tmp_path / "set", "v3.0", **changes))
    assert "\n" not in str(caught.value)


def test_damaged_and_missing_files_are_named(tmp_path: Path) -> None:
    folder = dataset(tmp_path / "set", "v3.0")
    empty = parquet.read_table(folder / "data/chunk-000/file-001.parquet").slice(0, 0)
    for path in (folder / "data/chunk-000").iterdir():
        parquet.write_table(empty, path)
    with pytest.raises(ValueError, match="has no rows, only the columns observation"):
        read(folder)
    (folder / "data/chunk-000/file-001.parquet").write_text("no Parquet")
    with pytest.raises(ValueError, match=r"file-001\.parquet is no readable Parquet file"):
        read(folder)
    shutil.rmtree(folder / "data")
    with pytest.raises(FileNotFoundError, match="has no data"):
        read(folder)
    (folder / "meta/info.json").write_text("{")
    with pytest.raises(ValueError, match=r"info\.json is no readable JSON"):
        read(folder)
    (folder / "meta/info.json").write_text("[1]")
    with pytest.raises(ValueError, match="must hold a JSON object"):
        read(folder)
    (folder / "meta/info.json").unlink()
    with pytest.raises(FileNotFoundError, match="no file meta/info"):
        read_lerobot(folder)
    with pytest.raises(ValueError, match="a folder is a LeRobotDataset"):
        read(folder)
