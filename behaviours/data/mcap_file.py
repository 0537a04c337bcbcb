"""MCAP recordings of ROS 2."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from behaviours.columns import Column
from behaviours.data.log import Log, needed

_COMMANDS = re.compile(r"geometry_msgs/(msg/)?Twist(Stamped)?|ackermann_msgs/(msg/)?AckermannDrive(Stamped)?")
_NOT_READ = {
    re.compile(r"(Image|CompressedImage|CompressedVideo|Theora\w*|FFMPEGPacket)$"): "images are not read",
    re.compile(r"(PointCloud2?|OccupancyGrid\w*|Costmap\w*|VoxelGrid)$"): "clouds of points and maps are not read",
    re.compile(r"(rcl_interfaces|diagnostic_msgs)/"): "it is about the software, not about the robot",
}
_TIMES = ("std_msgs/Header", "builtin_interfaces/Time")
_UNITS = {
    ("ackermann_msgs/AckermannDrive", "acceleration"): "m/s^2",
    ("ackermann_msgs/AckermannDrive", "speed"): "m/s",
    ("ackermann_msgs/AckermannDrive", "steering_angle"): "rad",
    ("geometry_msgs/Pose", "position"): "m",
    ("geometry_msgs/Twist", "angular"): "rad/s",
    ("geometry_msgs/Twist", "linear"): "m/s",
    ("sensor_msgs/Imu", "angular_velocity"): "rad/s",
    ("sensor_msgs/Imu", "linear_acceleration"): "m/s^2",
    ("sensor_msgs/LaserScan", "ranges"): "m",
    ("sensor_msgs/Range", "range"): "m",
}
"""The units that the definitions of these messages state, of all numbers below a field."""
_MOST = 4096
"""Longer arrays are no readings of single sensors; the longest laser scans have fewer."""


@dataclass
class _Leaf:
    """The values of a field by message: numbers, arrays of numbers, or texts."""

    unit: str
    rows: list[int] = field(default_factory=list)
    values: list[Any] = field(default_factory=list)
    limits: tuple[float, float] | None = None
    """What counts as nothing near and as too near, where the message says so."""


@dataclass
class _Topic:
    """The messages of a topic."""

    kind: str
    times: list[int] = field(default_factory=list)
    leaves: dict[str, _Leaf] = field(default_factory=dict)


def read_mcap(path: str | Path, topics: Sequence[str] | None = None, commands: str | None = None) -> Log:
    """Read the numbers and texts of a ROS 2 recording: an MCAP file, or the folder of a bag with such files.

        log = read_mcap("bag", ["/scan", "/odom", "/cmd_vel"])

    Topics have different rates: there is one row per message of the topic of commands, with the last message of each
    other topic at or before it, by the time of recording. What has not come yet, and what a message does not hold, is
    not observed (NaN). `rate` is that of the commands, from the median of their distances.

    A field becomes the column `topic.field`, such as `odom.pose.pose.position.x`; an array a column per element,
    `scan.ranges[0]`. Time stamps, images, clouds of points, maps, arrays of messages or texts, and arrays of more than
    4,096 numbers are left out, and so are commands that never change. Infinite ranges of `LaserScan` and `Range` become
    their `range_max` or `range_min`; other infinite numbers are not observed. Units are those that the definitions of
    common messages state. The whole recording is one run.

    Args:
        path: The file or folder.
        topics: The topics to read, by default all; that of the commands among them.
        commands: The topic of commands; by default the only one of type `Twist`, `TwistStamped` or `AckermannDrive`.

    Needs mcap and mcap-ros2-support. Raises `ValueError` in one line for topics that are not in the recording, if the
    topic of commands is not clear or never changes, and for a file that is damaged or not of ROS 2.

    Source: the MCAP specification, https://mcap.dev/spec; units as in REP 103, infinite ranges as in REP 117.
    """
    path = Path(path)
    left_out: dict[str, str] = {}
    found: dict[str, _Topic] = {}
    for file in _files(path):
        _read(file, topics, found, left_out)
    missing = [topic for topic in (*(topics or ()), *([commands] if commands else [])) if topic not in found]
    if missing:
        why = f": {left_out[missing[0]]}" if missing[0] in left_out else f"; there are {', '.join(sorted(found))}"
        raise ValueError(f"{path}: topic {missing[0]!r} cannot be read{why}")
    commands = _commanded(path, found) if commands is None else commands
    for name in [name for name, topic in found.items() if not topic.times]:
        left_out[name] = "it has no messages"
        del found[name]
    if commands not in found:
        raise ValueError(f"{path}: the topic of commands, {commands}, has no messages")
    times = np.sort(np.array(found[commands].times, dtype=np.int64))
    columns: dict[str, Column] = {}
    units, ranges = {}, {}
    for name, topic in found.items():
        messages = _latest(times, topic)
        for leaf_name, leaf in topic.leaves.items():
            made = _columns(f"{name.lstrip('/')}.{leaf_name}", leaf, len(topic.times), messages)
            if name == commands:
                made = {title: column for title, column in made.items() if not _constant(title, column, left_out)}
            columns |= made
            units |= dict.fromkeys(made, leaf.unit) if leaf.unit else {}
            ranges |= dict.fromkeys(made, leaf.limits) if leaf.limits else {}
    start = f"{commands.lstrip('/')}."
    actuators = [name for name in columns if name.startswith(start)]
    if not actuators:
        raise ValueError(f"{path}: no number of {commands} ever changes, so that there is nothing to learn")
    if len(actuators) == len(columns):
        raise ValueError(f"{path}: no other topic than {commands} has numbers or text that can be read")
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    return Log(
        columns,
        units,
        ranges,
        sensors=[name for name in columns if not name.startswith(start)],
        actuators=actuators,
        left_out=left_out,
        rate=1e9 / step if step > 0 else None,
    )


def is_bag(folder: Path) -> bool:
    """Whether a folder has MCAP files."""
    return next(folder.glob("*.mcap"), None) is not None


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"), key=lambda file: [int(number) for number in re.findall(r"\d+", file.stem)])
    if not files:
        raise FileNotFoundError(f"{path} has no files *.mcap")
    return files


def _read(path: Path, topics: Sequence[str] | None, found: dict[str, _Topic], left_out: dict[str, str]) -> None:
    """Add the messages of a file to those `found`; images and the like are not even decoded."""
    reader: Any = needed("mcap.reader", "an MCAP file", "mcap")
    decoder: Any = needed("mcap_ros2.decoder", "an MCAP file of ROS 2", "mcap-ros2-support")
    with path.open("rb") as file:
        try:
            opened = reader.make_reader(file, validate_crcs=True, decoder_factories=[decoder.DecoderFactory()])
            wanted = []
            for topic, kind, why in _channels(opened):
                if topics is not None and topic not in topics:
                    left_out[topic] = "not among the topics that were named"
                elif why:
                    left_out[topic] = why
                else:
                    found.setdefault(topic, _Topic(kind))
                    wanted.append(topic)
            for one in opened.iter_decoded_messages(topics=wanted) if wanted else ():
                topic = found[one.channel.topic]
                _add(topic, one.channel.topic, one.decoded_message, left_out)
                topic.times.append(one.message.log_time)
        # Damaged bytes raise anything: errors of mcap, of its compressors, of struct, of the decoders.
        except Exception as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise ValueError(f"{path} is no readable MCAP file of ROS 2: {reason:.200}") from None


def _channels(opened: Any) -> Iterator[tuple[str, str, str]]:
    """The topics of a file, the types of their messages, and why they are not read."""
    summary = opened.get_summary()
    if summary is not None and summary.channels:
        pairs = [(channel, summary.schemas.get(channel.schema_id)) for channel in summary.channels.values()]
    else:
        # A file without a summary, as of a recorder that was killed.
        seen = {channel.id: (channel, schema) for schema, channel, _ in opened.iter_messages()}
        pairs = list(seen.values())
    for channel, schema in pairs:
        kind = "" if schema is None else schema.name
        why = next((reason for pattern, reason in _NOT_READ.items() if pattern.search(kind)), "")
        if channel.message_encoding != "cdr" or schema is None or schema.encoding != "ros2msg":
            form = f"{channel.message_encoding}, {'no schema' if schema is None else schema.encoding}"
            why = f"its messages are encoded as {form}, not as cdr, ros2msg"
        yield channel.topic, kind, f"{kind}: {why}" if why else ""


def _add(topic: _Topic, name: str, message: Any, left_out: dict[str, str]) -> None:
    """Add the leaves of a message to its topic."""
    for leaf_name, unit, value, limits in _walk(message, "", "", f"{name.lstrip('/')}.", left_out):
        leaf = topic.leaves.setdefault(leaf_name, _Leaf(unit, limits=limits))
        leaf.rows.append(len(topic.times))
        leaf.values.append(value)


def _walk(
    message: Any, name: str, unit: str, start: str, left_out: dict[str, str]
) -> Iterator[tuple[str, str, Any, tuple[float, float] | None]]:
    """The leaves of a message: name, unit, value, and the limits of the ranges in it."""
    kind = type(message)._type
    ranges = None
    if kind in ("sensor_msgs/LaserScan", "sensor_msgs/Range") and 0 <= message.range_min < message.range_max < np.inf:
        ranges = float(message.range_min), float(message.range_max)
    for part in type(message).__slots__:
        limits = ranges if part in ("range", "ranges") else None
        value, own = getattr(message, part), f"{name}.{part}" if name else part
        unit_here = _UNITS.get((kind, part), unit)
        if getattr(type(value), "_type", None) in _TIMES:
            continue
        if hasattr(type(value), "_type"):
            yield from _walk(value, own, unit_here, start, left_out)
        elif isinstance(value, bool | int | float):
            yield own, unit_here, _finite(float(value), limits), limits
        elif isinstance(value, str):
            yield own, "", value, None
        elif len(value) > _MOST:
            left_out[start + own] = f"it is an array of {len(value):,} numbers"
        elif len(value) and (isinstance(value[0], str) or hasattr(type(value[0]), "_type")):
            left_out[start + own] = f"it is an array of {'texts' if isinstance(value[0], str) else 'messages'}"
        elif len(value):
            numbers = np.array(list(value) if isinstance(value, bytes) else value, dtype=np.float64)
            yield own, unit_here, _finite(numbers, limits), limits


def _finite(value: Any, limits: tuple[float, float] | None) -> Any:
    """Infinite numbers as the limits of their range, or as NaN."""
    low, high = (np.nan, np.nan) if limits is None else limits
    if isinstance(value, float):
        return (high if value > 0 else low) if math.isinf(value) else value
    return np.where(np.isinf(value), np.where(value > 0, high, low), value)


def _latest(times: Int64[np.ndarray, "N"], topic: _Topic) -> Int64[np.ndarray, "N"]:
    """The number of the last message of a topic at or before each time; -1 where there is none."""
    own = np.array(topic.times, dtype=np.int64)
    order = own.argsort(kind="stable")
    places = np.searchsorted(own[order], times, side="right") - 1
    return np.where(places < 0, -1, order[places])


def _columns(name: str, leaf: _Leaf, messages: int, chosen: Int64[np.ndarray, "N"]) -> dict[str, Column]:
    """The values of a field in the messages that are `chosen`, as a column, or one per element of an array."""
    places = np.full(messages + 1, -1)  # the last one is for messages that do not exist
    places[leaf.rows] = np.arange(len(leaf.rows))
    rows = places[chosen]
    if any(isinstance(value, str) for value in leaf.values):
        return {name: np.array([*leaf.values, None], dtype=object)[rows]}
    width = max(np.size(value) for value in leaf.values)
    table: Float64[np.ndarray, "rows width"] = np.full((len(leaf.values) + 1, width), np.nan)
    for row, value in zip(table, leaf.values, strict=False):
        row[: np.size(value)] = value
    if isinstance(leaf.values[0], float):
        return {name: table[rows, 0]}
    return {f"{name}[{place}]": table[rows, place] for place in range(width)}


def _constant(name: str, column: Column, left_out: dict[str, str]) -> bool:
    """Whether a command is text or never changes; then it is left out."""
    if column.dtype == object:
        left_out[name] = "it is text, and commands are numbers"
    elif (column == column[0]).all():
        left_out[name] = f"it is always {column[0]:g}"
    return name in left_out


def _commanded(path: Path, found: dict[str, _Topic]) -> str:
    """The only topic of a type that commands a vehicle."""
    candidates = [name for name, topic in found.items() if topic.times and _COMMANDS.fullmatch(topic.kind)]
    if len(candidates) == 1:
        return candidates[0]
    listed = ", ".join(f"{name} ({topic.kind})" for name, topic in sorted(found.items())) or "none that can be read"
    several = "several topics could be" if candidates else "no topic is known for"
    raise ValueError(f"{path}: {several} the commands: name one with commands=; the topics are {listed}")
