"""Minari's data sets, both ways."""

import os
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from behaviours import env_spaces
from behaviours.data.log import Log, needed
from behaviours.demonstrations import Demonstrations
from behaviours.schema import Schema

_SCHEMA = "torchvsa_schema"
"""Where the names and units are in the metadata of a data set that `write_minari` wrote."""
_LONGEST = 32_767
"""Minari 0.5.4 reads a batch of 32,768 rows of an episode from Arrow, and the last is no step."""
_ID = re.compile(r"([\w-]([\w-]|/(?!/))*[\w-]/)?[\w-]+-v\d+")


def read_minari(dataset: Any) -> Log:
    """Read the observations and actions of a Minari data set, stored as HDF5 or Arrow.

        log = read_minari("D4RL/door/human-v2")

    Observations are sensors and actions actuators, flattened and named as by `collect`, with the bounds of their spaces
    as ranges; a data set of `write_minari` has the names, units and ranges of its schema. A row is an observation and
    the action that answered it: the last observation of an episode is left out, and so are rewards, infos, images
    and text.

    Args:
        dataset: A `MinariDataset`, the folder of one, or the id of one on this machine. Nothing is downloaded.

    Needs minari, and h5py or pyarrow. Raises `FileNotFoundError` if there is no such data set, and `ValueError` for one
    that cannot be read, that has no steps, or whose observations or actions are not numbers.
    """
    minari: Any = needed("minari", "a Minari data set")
    try:
        opened = dataset if isinstance(dataset, minari.MinariDataset) else _opened(minari, dataset)
        if opened.storage.FORMAT == "arrow":
            _check_arrow(Path(opened.storage.data_path))
        metadata, found = opened.storage.metadata, list(opened.iterate_episodes())
    # Damaged files, and environments that are not installed, raise anything: errors of h5py, pyarrow, Gymnasium, json.
    except Exception as error:
        if isinstance(error, ImportError) or (isinstance(error, FileNotFoundError) and "there is no" in str(error)):
            raise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{dataset} is no readable Minari data set: {reason:.200}") from None
    schema = _schema(metadata)
    names = [None, None] if schema is None else [[one.name for one in part] for part in _parts(schema)]
    observed, left_out = env_spaces.elements_of(opened.observation_space, "observation", names[0])
    commanded, left_out_of_actions = env_spaces.elements_of(opened.action_space, "action", names[1])
    rows, episodes = [], []
    for episode in found:
        number, steps = episode.id, len(episode.rewards)
        seen, done = _rows(observed, episode.observations), _rows(commanded, episode.actions)
        if min(len(seen), len(done)) < steps:
            raise ValueError(f"{dataset}: episode {number} has {steps} rewards, but {len(seen)} observations")
        rows.append(np.concatenate([seen[:steps], done[:steps]], 1))
        episodes.append(np.full(steps, number, dtype=np.int64))
    if (steps := sum(map(len, rows))) == 0 or steps != opened.total_steps:
        # Minari reads episodes from Arrow in one batch, and loses the rest of long ones.
        raise ValueError(f"{dataset}: {steps} steps could be read; its metadata say {opened.total_steps}")
    elements, columns = (*observed, *commanded), np.concatenate(rows).T
    ranges = {element.name: (element.low, element.high) for element in elements if element.bounded}
    if schema is not None:
        ranges = {part.name: (part.low, part.high) for parts in _parts(schema) for part in parts}
    return Log(
        {element.name: np.ascontiguousarray(column) for element, column in zip(elements, columns, strict=True)},
        {} if schema is None else {part.name: part.unit for parts in _parts(schema) for part in parts if part.unit},
        ranges,
        np.concatenate(episodes),
        [element.name for element in observed],
        [element.name for element in commanded],
        {**left_out, **left_out_of_actions, "rewards, infos": "they are neither observations nor actions"},
    )


def write_minari(
    shown: Demonstrations, schema: Schema, dataset_id: str, *, data_format: str = "hdf5", description: str = ""
) -> Any:
    """Write demonstrations as a Minari data set, completely or not at all; returns its `MinariDataset`.

        write_minari(shown, schema, "my-robot/follow-wall-v0")

    Observations and actions are float64 arrays of the space `Box`, with a bound per sensor and actuator: the range of
    the schema, widened where readings exceed it. NaN is not observed. Demonstrations know no rewards and no observation
    after the last command: rewards are 0, and the last reading of an episode is repeated, whose end is a truncation.
    Episodes are numbered from 0 in the order of their numbers. The schema is in the metadata, so that
    `read_minari` knows names and units.

    Args:
        shown: The demonstrations.
        schema: Their sensors and actuators.
        dataset_id: `(namespace/)name-v(version)`. The data set is in the folder `MINARI_DATASETS_PATH`, by default
            `~/.minari/datasets`.
        data_format: `"hdf5"` or `"arrow"`.
        description: What the demonstrations show, for the metadata.

    Needs minari, and h5py or pyarrow. Raises `ValueError` for demonstrations that are not of this schema, for a
    malformed id, for an id that exists, for another format, and for episodes of more than 32,767 steps in Arrow.
    """
    minari: Any = needed("minari", "a Minari data set")
    spaces: Any = needed("gymnasium.spaces", "a Minari data set", "gymnasium")
    storages: Any = needed("minari.dataset.minari_storage", "a Minari data set", "minari")
    if not _ID.fullmatch(dataset_id):
        raise ValueError(f"dataset_id is (namespace/)name-v(version), such as 'robot/wall-v0'; got {dataset_id!r:.80}")
    if data_format not in ("hdf5", "arrow"):
        raise ValueError(f"data_format is 'hdf5' or 'arrow'; got {data_format!r}")
    shown.check(schema)
    target = needed("minari.storage.datasets_root_dir", "a Minari data set", "minari").get_dataset_path(dataset_id)
    target = target.absolute()  # Minari joins a relative folder to itself
    if target.exists():
        raise ValueError(f"there is a data set {dataset_id} already, in {target}; take another name or version")
    longest = int(shown.episodes.unique(return_counts=True)[1].max())
    if data_format == "arrow" and longest > _LONGEST:
        raise ValueError(
            f"Minari reads {_LONGEST:,} steps an episode from Arrow; there is one of {longest:,}: use 'hdf5'"
        )
    readings, commands = shown.sensors.cpu().numpy(), shown.commands.cpu().numpy()
    if "/" in dataset_id:
        namespaces: Any = needed("minari.namespace", "a Minari data set", "minari")
        if (namespace := dataset_id.rpartition("/")[0]) not in namespaces.list_local_namespaces():
            namespaces.create_namespace(namespace)
    target.parent.mkdir(parents=True, exist_ok=True)
    # The name begins with a point, so that Minari does not list it while it is written.
    temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    try:
        storage = storages.MinariStorage.new(
            temporary / "data",
            observation_space=_box(spaces, schema.sensors, readings),
            action_space=_box(spaces, schema.actuators, commands),
            data_format=data_format,
        )
        about = {"dataset_id": dataset_id, "minari_version": minari.__version__, _SCHEMA: schema.to_dict()}
        storage.update_metadata(about | ({"description": description} if description else {}))
        storage.update_episodes(_buffers(minari, shown.episodes.cpu().numpy(), readings, commands))
        temporary.chmod(0o755)
        os.replace(temporary, target)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise
    return minari.MinariDataset(target / "data")


def is_minari(folder: Path) -> bool:
    """Whether a folder is a Minari data set, or the folder `data` of one."""
    path = _data_folder(folder) / "metadata.json"
    return path.is_file() and '"minari_version"' in path.read_text(encoding="utf-8", errors="replace")


def _opened(minari: Any, dataset: Any) -> Any:
    if not isinstance(dataset, str | os.PathLike):
        raise ValueError("expected a MinariDataset, its folder or its id")
    folder = Path(dataset).expanduser()
    if folder.is_dir():
        return minari.MinariDataset(_data_folder(folder))
    root = needed("minari.storage.datasets_root_dir", "a Minari data set", "minari").get_dataset_path()
    if not (root / str(dataset) / "data").is_dir():
        raise FileNotFoundError(f"there is no folder {dataset}, and no Minari data set with this id in {root}")
    return minari.load_dataset(str(dataset))


def _check_arrow(folder: Path) -> None:
    """Raise for damaged Arrow files, with which Minari's way of reading would end the process."""
    pyarrow: Any = needed("pyarrow", "a Minari data set")
    ipc: Any = needed("pyarrow.ipc", "a Minari data set", "pyarrow")
    for path in folder.glob("*/*.arrow"):
        with pyarrow.memory_map(str(path)) as source, ipc.open_file(source) as file:
            for place in range(file.num_record_batches):
                batch = file.get_batch(place)
                if batch.num_rows < 0:
                    raise ValueError(f"{path.parent.name}/{path.name} is damaged")
                batch.validate(full=True)


def _data_folder(folder: Path) -> Path:
    return folder / "data" if (folder / "data" / "metadata.json").is_file() else folder


def _parts(schema: Schema) -> tuple[Any, Any]:
    return schema.sensors, schema.actuators


def _schema(metadata: dict[str, Any]) -> Schema | None:
    """The schema that `write_minari` left in the metadata."""
    given = metadata.get(_SCHEMA)
    try:
        return None if given is None else Schema.from_dict(given)
    except (TypeError, KeyError, ValueError) as error:
        raise ValueError(f"the metadata {_SCHEMA} are no schema of this version: {error}") from None


def _rows(elements: list[env_spaces.Element], values: Any) -> Float64[np.ndarray, "rows n"]:
    """The elements of the observations or actions of an episode."""
    first = values
    for key in elements[0].path:
        first = first[key]
    return env_spaces.rows_of(elements, values, len(first))


def _box(spaces: Any, parts: Any, rows: Float64[np.ndarray, "N n"]) -> Any:
    """The space of these sensors or actuators, which holds all rows."""
    low, high = (np.array([getattr(part, which) for part in parts], dtype=np.float64) for which in ("low", "high"))
    return spaces.Box(np.fmin(low, np.fmin.reduce(rows)), np.fmax(high, np.fmax.reduce(rows)), dtype=np.float64)


def _buffers(minari: Any, episodes: Any, readings: Any, commands: Any) -> list[Any]:
    """A buffer of Minari for each episode."""
    buffer: Any = needed("minari.data_collector.episode_buffer", "a Minari data set", "minari").EpisodeBuffer
    found = []
    for number, episode in enumerate(np.unique(episodes).tolist()):
        chosen = np.flatnonzero(episodes == episode)
        last = np.arange(len(chosen)) == len(chosen) - 1
        found.append(
            buffer(
                id=number,
                observations=readings[np.append(chosen, chosen[-1])],
                actions=commands[chosen],
                rewards=np.zeros(len(chosen)),
                terminations=np.zeros(len(chosen), dtype=np.bool_),
                truncations=last,
            )
        )
    return found
