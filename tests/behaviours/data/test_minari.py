"""Minari's data sets, in both of its storages: those it wrote are read, and those we write it reads."""

import json
import math
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import minari
import numpy as np
import pytest
import torch
from gymnasium import spaces
from minari.data_collector import EpisodeBuffer

from behaviours import Actuator, Demonstrations, Schema, Sensor
from behaviours.data import read, read_minari, write_minari

FORMATS = ["hdf5", "arrow"]
SEEN = spaces.Dict(
    {
        "arm": spaces.Tuple((spaces.Box(-1, 1, (2,)), spaces.Discrete(3, start=-1))),
        "camera": spaces.Box(0, 255, (32, 32, 3), np.uint8),
        "lamps": spaces.MultiBinary(2),
        "speed": spaces.Box(-math.inf, math.inf, (1,), np.float64),
    }
)
DONE = spaces.Box(-2, 2, (1,))
LENGTHS = [3, 1, 4]


@pytest.fixture(autouse=True)
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of all data sets."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "sets"))
    return tmp_path / "sets"


def created(data_format: str, name: str = "robot/reach-v0", **options: Any) -> tuple[list[EpisodeBuffer], Any]:
    """A data set that Minari itself writes, and its episodes."""
    SEEN.seed(0)
    DONE.seed(0)
    buffers = []
    for length in LENGTHS:
        shown = [SEEN.sample() for _ in range(length + 1)]
        stacked = {
            "arm": tuple(np.stack([one["arm"][place] for one in shown]) for place in range(2)),
            **{key: np.stack([one[key] for one in shown]) for key in ("camera", "lamps", "speed")},
        }
        acted: Any = np.stack([DONE.sample() for _ in range(length)])
        ends = [place == length - 1 for place in range(length)]
        buffers.append(EpisodeBuffer(None, None, None, stacked, acted, [1.0] * length, ends, [False] * length))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about authors and links that are not given
        found = minari.create_dataset_from_buffers(
            name, buffers, observation_space=SEEN, action_space=DONE, data_format=data_format, **options
        )
    return buffers, found


@pytest.mark.parametrize("data_format", FORMATS)
def test_what_minari_writes_is_read(data_format: str, root: Path) -> None:
    buffers, opened = created(data_format)
    for given in (opened, "robot/reach-v0", root / "robot/reach-v0", str(root / "robot/reach-v0/data")):
        log = read_minari(given)
        sensors = [f"observation.arm[0][{place}]" for place in range(2)] + ["observation.arm[1]"]
        sensors += ["observation.lamps[0]", "observation.lamps[1]", "observation.speed"]
        assert log.sensors == sensors
        assert log.columns == [*sensors, "action"]
        assert log.episodes is not None
        assert log.episodes.tolist() == [0] * 3 + [1] + [2] * 4
        seen: list[Any] = [buffer.observations for buffer in buffers]
        acted: list[Any] = [buffer.actions for buffer in buffers]
        expected = {
            "observation.arm[0][1]": [one["arm"][0][:-1, 1] for one in seen],
            "observation.arm[1]": [one["arm"][1][:-1] for one in seen],
            "observation.lamps[0]": [one["lamps"][:-1, 0] for one in seen],
            "observation.speed": [one["speed"][:-1, 0] for one in seen],
            "action": [actions[:, 0] for actions in acted],
        }
        for name, parts in expected.items():
            assert np.array_equal(log[name], np.concatenate(parts)), name
        assert log.ranges["action"] == (-2, 2)
        assert "observation.speed" not in log.ranges
        assert "32 x 32 x 3" in log.left_out["observation.camera"]
    assert read(root / "robot/reach-v0").columns == log.columns


def test_a_part_of_a_data_set_keeps_its_numbers() -> None:
    opened = created("hdf5")[1]
    log = read_minari(opened.filter_episodes(lambda episode: len(episode.rewards) > 1))
    assert log.episodes is not None
    assert log.episodes.tolist() == [0] * 3 + [2] * 4


SCHEMA = Schema(
    [
        Sensor("front", 0, 4, unit="m", out_of_range="clip"),
        Sensor("heading", -180, 180, unit="deg", kind="angle"),
        Sensor("mode", kind="categorical", values=("search", "follow")),
    ],
    [Actuator("v", -1, 1, unit="m/s", levels=3), Actuator("omega", -2, 2)],
)


def demonstrations() -> Demonstrations:
    places = np.arange(12.0)
    readings = np.stack([np.where(places == 5, np.nan, places / 2), 40 * places, places % 2], 1)
    commands = np.stack([places % 3 - 1, places / 12], 1)
    return Demonstrations(readings, commands, [7, 7, 3, 3, 3, 7] * 2, schema=SCHEMA)


@pytest.mark.parametrize("data_format", FORMATS)
def test_what_is_written_is_read_again_and_by_minari(data_format: str) -> None:
    shown = demonstrations()
    written = write_minari(shown, SCHEMA, "own/wall-v1", data_format=data_format, description="follows a wall")
    opened = minari.load_dataset("own/wall-v1")
    assert opened.id == written.id == "own/wall-v1"
    assert list(minari.list_local_datasets()) == ["own/wall-v1"]
    assert (opened.total_episodes, opened.total_steps) == (2, 12)
    assert opened.storage.metadata["description"] == "follows a wall"
    order = np.argsort(shown.episodes.numpy(), kind="stable")
    first = opened[0]
    assert np.array_equal(first.observations[:-1], shown.sensors.numpy()[order[:6]], equal_nan=True)
    assert np.array_equal(first.observations[-1], first.observations[-2])
    assert first.truncations.tolist() == [False] * 5 + [True]
    assert not first.terminations.any()
    assert not first.rewards.any()
    assert opened.observation_space.contains(first.observations[0])
    assert opened.observation_space.high.tolist() == [5.5, 440, 1]
    log = read_minari("own/wall-v1")
    assert log.units == {"front": "m", "heading": "deg", "v": "m/s"}
    assert log.ranges["front"] == (0, 4)
    again = Demonstrations.from_data(log, SCHEMA)
    assert torch.equal(again.sensors.nan_to_num(-1), shown.sensors[order].nan_to_num(-1))
    assert torch.equal(again.commands, shown.commands[order])
    assert again.episodes.tolist() == [0] * 6 + [1] * 6
    assert again.units == log.units


def test_a_folder_of_data_sets_may_be_relative(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", "here")
    write_minari(demonstrations(), SCHEMA, "own/wall-v0")
    assert len(read_minari("own/wall-v0")) == len(demonstrations())
    assert [path.name for path in (tmp_path / "here" / "own").glob("*v0")] == ["wall-v0"]


def test_jax_is_not_needed() -> None:
    write_minari(demonstrations(), SCHEMA, "wall-v0")
    assert len(read_minari("wall-v0")) == 12
    assert "jax" not in sys.modules


@pytest.mark.parametrize("data_format", FORMATS)
def test_long_episodes_come_back_whole_or_are_refused(data_format: str) -> None:
    schema = Schema([Sensor("a", 0, 1)], [Actuator("b", 0, 1)])
    rows = np.random.default_rng(0).random((32_768, 1))
    fits, long = (Demonstrations(part, part, schema=schema) for part in (rows[1:], rows))
    write_minari(fits, schema, "long-v0", data_format=data_format)
    assert np.array_equal(read_minari("long-v0")["b"], rows[1:, 0])
    if data_format == "arrow":
        with pytest.raises(ValueError, match="Minari reads 32,767 steps an episode"):
            write_minari(long, schema, "long-v1", data_format=data_format)
    else:
        write_minari(long, schema, "long-v1", data_format=data_format)
        assert len(read_minari("long-v1")) == 32_768


def test_what_cannot_be_written_leaves_nothing_behind(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = demonstrations()
    for name in ("wall", "wall-v0/", "../wall-v0", "a//b/wall-v0", ""):
        with pytest.raises(ValueError, match="dataset_id is"):
            write_minari(shown, SCHEMA, name)
    with pytest.raises(ValueError, match="data_format is 'hdf5' or 'arrow'; got 'csv'"):
        write_minari(shown, SCHEMA, "wall-v0", data_format="csv")
    narrow = Schema(SCHEMA.sensors, [Actuator("v", -1, 1), Actuator("omega", 0, 0.5)])
    with pytest.raises(ValueError, match=r"actuator 'omega' has the command 0\.58"):
        write_minari(shown, narrow, "wall-v0")
    write_minari(shown, SCHEMA, "wall-v0")
    with pytest.raises(ValueError, match="there is a data set wall-v0 already"):
        write_minari(shown, SCHEMA, "wall-v0")

    def failing(*_: Any) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr("minari.dataset._storages.hdf5_storage.HDF5Storage.update_episodes", failing)
    with pytest.raises(OSError, match="no space"):
        write_minari(shown, SCHEMA, "wall-v1")
    assert [path.name for path in root.iterdir()] == ["wall-v0"]


def test_what_is_no_data_set_takes_one_line(root: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no folder nowhere-v0, and no Minari data set with this id in"):
        read_minari("nowhere-v0")
    with pytest.raises(ValueError, match="expected a MinariDataset, its folder or its id"):
        read_minari(gymnasium)
    write_minari(demonstrations(), SCHEMA, "wall-v0")
    folder = root / "wall-v0"
    about = folder / "data/metadata.json"
    text = about.read_text()
    for wrong in ({"total_steps": 13}, {"data_format": "xyz"}, {"torchvsa_schema": {"sensors": 1}}):
        about.write_text(json.dumps(json.loads(text) | wrong))
        with pytest.raises(ValueError, match=r"wall-v0|torchvsa_schema") as caught:
            read(folder)
        assert "\n" not in str(caught.value)
    about.write_text(text)
    (folder / "data/main_data.hdf5").write_text("no HDF5")
    with pytest.raises(ValueError, match="is no readable Minari data set"):
        read(folder)


def test_damaged_arrow_is_read_or_refused_and_never_ends_the_process(root: Path) -> None:
    write_minari(demonstrations(), SCHEMA, "wall-v0", data_format="arrow")
    path = root / "wall-v0/data/0/part-0.arrow"
    content, refused = path.read_bytes(), []
    for place in range(0, len(content), 9):
        damaged = bytearray(content)
        damaged[place] ^= 255
        path.write_bytes(damaged)
        try:
            read(root / "wall-v0")
        except ValueError as error:
            refused.append(str(error))
    assert len(refused) > 20
    assert not any("\n" in reason for reason in refused)
