"""LeRobotDataset folders."""

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from behaviours.columns import Column
from behaviours.data.log import Log, array_of, needed

_VERSIONS = ("v2.0", "v2.1", "v3.")
_COUNTERS = {
    "episode_index": "it names the episodes",
    "frame_index": "it counts the rows of an episode",
    "index": "it counts the rows",
    "timestamp": "it is the time of a row",
    "task_index": "it is the number of a task, not a reading",
}
_NUMBERS = re.compile(r"(float|u?int)\d+|bool")


def read_lerobot(folder: str | Path) -> Log:
    """Read the readings and commands of a LeRobotDataset, version 2.0, 2.1 or 3, from its folder.

        log = read_lerobot("~/.cache/huggingface/lerobot/lerobot/aloha_static_coffee")

    `observation.*` are sensors and `action` is the actuators. A feature with several elements becomes one column per
    element: `observation.state.shoulder_pan.pos` with the names in `meta/info.json`, `observation.state[0]` without.
    Ranges are the smallest and the largest value in `meta/stats.json` or `meta/episodes_stats.jsonl`, where there is
    one. Images, videos, rewards, counters and features with more than one dimension are left out. `rate` is the number
    of frames per second.

    Needs pyarrow, not `lerobot`. Raises `FileNotFoundError` for a folder without `meta/info.json` or data, and
    `ValueError`, naming the file, for other versions, damaged files, and data that are not as the features say.

    Source: the dataset format of LeRobot, https://huggingface.co/docs/lerobot.
    """
    folder = Path(folder).expanduser()
    info = _info(folder)
    wanted, left_out = _wanted(info["features"])
    if not any(name == "action" or name.startswith("action.") for name in wanted):
        raise ValueError(f"{folder}: meta/info.json has no numeric feature 'action' (features: {_listed(info)})")
    parts = [_read(path, wanted) for path in _data_files(folder)]
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    episodes = columns.pop("episode_index").astype(np.int64)
    if len(episodes) == 0:
        raise ValueError(f"{folder} has no rows, only the columns {', '.join(columns)}")
    found = len(np.unique(episodes))
    if isinstance(total := info.get("total_episodes"), int) and found < total:
        left_out[f"{total - found} of {total} episodes"] = "their files are not in the folder"
    ranges = _ranges(folder, wanted)
    rate = info.get("fps")
    return Log(
        columns,
        ranges={name: ranges[name] for name in columns if name in ranges},
        episodes=episodes,
        sensors=[name for feature in wanted if feature.startswith("observation.") for name in wanted[feature]],
        actuators=[name for feature in wanted if not feature.startswith("observation.") for name in wanted[feature]],
        left_out=left_out,
        rate=float(rate) if isinstance(rate, int | float) and rate > 0 else None,
    )


def is_lerobot(folder: Path) -> bool:
    """Whether a folder holds a LeRobotDataset."""
    return (folder / "meta" / "info.json").is_file()


def _info(folder: Path) -> dict[str, Any]:
    """The description of a data set. Raises `ValueError` unless it is of a known version and has features."""
    path = folder / "meta" / "info.json"
    if not path.is_file():
        raise FileNotFoundError(f"{folder} is no LeRobotDataset: there is no file meta/info.json")
    info = _json(path.read_text(encoding="utf-8", errors="replace"), path)
    version = info.get("codebase_version")
    if not isinstance(version, str) or not version.startswith(_VERSIONS):
        raise ValueError(f"{path}: codebase_version is {version!r:.40}; versions 2.0, 2.1 and 3 are read")
    features = info.get("features")
    if not isinstance(features, dict) or not all(isinstance(feature, dict) for feature in features.values()):
        raise ValueError(f"{path}: features must map names to descriptions; got {features!r:.80}")
    return info


def _json(text: str, path: Path) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is no readable JSON: {error}") from None
    if not isinstance(found, dict):
        raise ValueError(f"{path} must hold a JSON object; got {text.strip()!r:.40}")
    return found


def _listed(info: Mapping[str, Any]) -> str:
    return ", ".join(info["features"]) or "none"


def _wanted(features: Mapping[str, Any]) -> tuple[dict[str, list[str]], dict[str, str]]:
    """The names of the columns of each feature that is read, and why the other features are left out."""
    wanted: dict[str, list[str]] = {}
    left_out: dict[str, str] = {}
    for name, feature in features.items():
        kind, shape = str(feature.get("dtype")), feature.get("shape")
        # Scalars have the shape [1], or [] in some early files.
        shape = [1] if shape in ([], None) else shape
        if kind in ("video", "image"):
            left_out[name] = f"it is {'a video' if kind == 'video' else 'images'}, and images are not read"
        elif name in _COUNTERS:
            left_out[name] = _COUNTERS[name]
        elif not re.match(r"(observation|action)(\.|$)", name):
            left_out[name] = "it is neither an observation nor an action"
        elif kind != "string" and not _NUMBERS.fullmatch(kind):
            left_out[name] = f"it holds {kind}, not numbers or text"
        elif not isinstance(shape, list) or len(shape) != 1 or type(shape[0]) is not int or shape[0] < 1:
            left_out[name] = f"it has the shape {shape!r:.40}, not that of one row of numbers"
        elif kind == "string" and shape != [1]:
            left_out[name] = "it holds several texts a row"
        else:
            wanted[name] = _names(name, shape[0], feature.get("names"))
    names = [name for columns in wanted.values() for name in columns]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"two features of meta/info.json have an element with the name {twice[0]!r}")
    return wanted, left_out


def _names(feature: str, count: int, given: Any) -> list[str]:
    """The names of the columns of a feature, from its names in one of the forms in use."""
    if isinstance(given, dict) and all(type(place) is int for place in given.values()):
        given = sorted(given, key=given.__getitem__)  # {"delta_x": 0, "delta_y": 1}
    elif isinstance(given, dict):
        given = [name for names in given.values() for name in (names if isinstance(names, list) else [names])]
    valid = isinstance(given, list) and all(isinstance(name, str) and name for name in given)
    if valid and len(given) == count == len(set(given)) and given != [feature]:
        return [f"{feature}.{name}" for name in given]
    return [feature] if count == 1 else [f"{feature}[{place}]" for place in range(count)]


def _data_files(folder: Path) -> list[Path]:
    paths = list(folder.glob("data/chunk-*/*.parquet"))
    if not paths:
        raise FileNotFoundError(f"{folder} has no data: there are no files data/chunk-*/*.parquet")
    # By the numbers in their names: chunk-1000 comes after chunk-999.
    return sorted(paths, key=lambda path: [int(one) for one in re.findall(r"\d+", f"{path.parent.name}/{path.name}")])


def _read(path: Path, wanted: Mapping[str, list[str]]) -> dict[str, Column]:
    """The columns of a data file. Raises `ValueError` if it does not hold what the features say."""
    parquet: Any = needed("pyarrow.parquet", "a LeRobotDataset", "pyarrow")
    pyarrow: Any = needed("pyarrow", "a LeRobotDataset")
    try:
        with parquet.ParquetFile(path) as file:
            missing = [name for name in ("episode_index", *wanted) if name not in file.schema_arrow.names]
            if missing:
                raise ValueError(f"{path} has no column {missing[0]!r}, which meta/info.json names")
            table = file.read(["episode_index", *wanted])
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is no readable Parquet file: {' '.join(str(error).split())}") from None
    columns = {"episode_index": array_of(table["episode_index"])}
    if columns["episode_index"].dtype.kind not in "iu":
        raise ValueError(f"{path}: episode_index must hold a whole number in each row")
    for feature, names in wanted.items():
        columns |= zip(names, _elements(table[feature], len(names), f"{path}: column {feature!r}"), strict=True)
    return columns


def _elements(column: Any, count: int, what: str) -> list[Column]:
    """The `count` elements of the rows of a column, each as a column; rows without a value are NaN."""
    types = needed("pyarrow", "a LeRobotDataset").types
    compute: Any = needed("pyarrow.compute", "a LeRobotDataset", "pyarrow")
    if not any(getattr(types, check)(column.type) for check in ("is_list", "is_large_list", "is_fixed_size_list")):
        if count > 1:
            raise ValueError(f"{what} holds {column.type}, but meta/info.json says {count} numbers a row")
        return [array_of(column)]
    lengths = compute.list_value_length(column).drop_null().unique().to_pylist()
    if lengths not in ([], [count]):
        raise ValueError(f"{what} has rows of {', '.join(map(str, sorted(lengths)))} numbers, not of {count}")
    values = array_of(compute.list_flatten(column))
    if values.dtype.kind not in "biuf":
        raise ValueError(f"{what} holds {column.type}, not numbers")
    values = values.reshape(-1, count)
    if column.null_count:
        filled = np.full((len(column), count), np.nan)
        filled[column.is_valid().to_numpy()] = values
        values = filled
    return [np.ascontiguousarray(values[:, place]) for place in range(count)]


def _ranges(folder: Path, wanted: Mapping[str, list[str]]) -> dict[str, tuple[float, float]]:
    """The range of each column, over the statistics of all episodes; without those of features that have none."""
    one, lines = folder / "meta" / "stats.json", folder / "meta" / "episodes_stats.jsonl"
    if one.is_file():
        found = [_json(one.read_text(encoding="utf-8", errors="replace"), one)]
    elif lines.is_file():
        with lines.open(encoding="utf-8", errors="replace") as file:
            found = [_json(line, lines).get("stats") for line in file if line.strip()]
    else:
        return {}
    ranges: dict[str, tuple[float, float]] = {}
    for feature, names in wanted.items():
        for stats in found:
            known = stats.get(feature) if isinstance(stats, dict) else None
            lows, highs = (_bounds(known, which, len(names)) for which in ("min", "max"))
            for name, low, high in zip(names, lows, highs, strict=False):
                before = ranges.get(name, (math.inf, -math.inf))
                ranges[name] = min(before[0], low), max(before[1], high)
    return {name: bounds for name, bounds in ranges.items() if math.isfinite(bounds[1] - bounds[0])}


def _bounds(stats: Any, which: str, count: int) -> list[float]:
    """The bounds of the elements of a feature; empty unless there are `count` numbers."""
    given = stats.get(which) if isinstance(stats, dict) else None
    values: list[Any] = given if isinstance(given, list) else [given]
    valid = len(values) == count and all(isinstance(value, int | float) and abs(value) < math.inf for value in values)
    return [float(value) for value in values] if valid else []
