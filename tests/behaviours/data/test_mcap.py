"""Recordings of ROS 2, written by mcap's own writer, become rows at the rate of the commands."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer as PlainWriter
from mcap_ros2.writer import Writer

from behaviours import Demonstrations, Schema
from behaviours.data import read, read_mcap

VECTOR = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z"
HEADER = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
TIME = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec"


def definition(*parts: str) -> str:
    return f"\n{'=' * 80}\n".join(parts)


TYPES = {
    "geometry_msgs/msg/Twist": definition("geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular", VECTOR),
    "sensor_msgs/msg/LaserScan": definition(
        "std_msgs/Header header\nfloat32 range_min\nfloat32 range_max\nfloat32[] ranges\nfloat32[] intensities",
        HEADER,
        TIME,
    ),
    "sensor_msgs/msg/Image": definition("std_msgs/Header header\nuint32 height\nuint8[] data", HEADER, TIME),
    "std_msgs/msg/String": "string data",
    "own_msgs/msg/State": definition(
        "bool docked\nuint8[2] bumpers\nfloat64 charge\nstring[] faults\ngeometry_msgs/Vector3[] path\n"
        "float32[5000] map\nbuiltin_interfaces/Time since",
        VECTOR,
        TIME,
    ),
}
STAMP = {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "base"}


def twist(v: float, omega: float) -> dict[str, Any]:
    return {"linear": {"x": v, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": omega}}


def scan(*ranges: float) -> dict[str, Any]:
    return {"header": STAMP, "range_min": 0.125, "range_max": 8.0, "ranges": ranges, "intensities": []}


def state(charge: float) -> dict[str, Any]:
    fixed = {"faults": ["none"], "path": [{"x": 0.0, "y": 0.0, "z": 0.0}], "map": [0.0] * 5000}
    return {
        "docked": charge > 1,
        "bumpers": [0, int(charge)],
        "charge": charge,
        "since": {"sec": 0, "nanosec": 1},
    } | fixed


Message = tuple[str, str, int, dict[str, Any]]
TWIST, SCAN, IMAGE = "geometry_msgs/msg/Twist", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/Image"
MESSAGES: list[Message] = [
    ("/scan", SCAN, 150, scan(1.0, 2.0)),
    ("/cmd_vel", TWIST, 100, twist(0.25, 0.0)),
    ("/camera/image", IMAGE, 110, {"header": STAMP, "height": 1, "data": b"123"}),
    ("/scan", SCAN, 200, scan(3.0, math.inf, 4.0)),
    ("/cmd_vel", TWIST, 200, twist(0.5, -1.0)),
    ("/scan", SCAN, 310, scan(-math.inf, math.nan)),
    ("/cmd_vel", TWIST, 300, twist(0.0, 1.0)),
    ("/robot/state", "own_msgs/msg/State", 250, state(1.0)),
    ("/robot/state", "own_msgs/msg/State", 399, state(2.0)),
    ("/mode", "std_msgs/msg/String", 100, {"data": "search"}),
    ("/mode", "std_msgs/msg/String", 350, {"data": "follow"}),
    ("/cmd_vel", TWIST, 400, twist(0.5, 0.5)),
]


def write(path: Path, messages: list[Message] = MESSAGES) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file, Writer(file) as writer:
        schemas = {kind: writer.register_msgdef(kind, TYPES[kind]) for _, kind, _, _ in messages}
        for topic, kind, milliseconds, message in messages:
            writer.write_message(topic, schemas[kind], message, log_time=milliseconds * 10**6)
    return path


NAN = math.nan


def test_each_row_is_a_command_with_the_last_message_of_every_other_topic(tmp_path: Path) -> None:
    log = read(write(tmp_path / "run.mcap"))
    expected = {
        "cmd_vel.linear.x": [0.25, 0.5, 0, 0.5],
        "cmd_vel.angular.z": [0, -1, 1, 0.5],
        # The message of the same time counts, the one 10 ms later does not; an infinite range is the largest one.
        "scan.ranges[0]": [NAN, 3, 3, 0.125],
        "scan.ranges[1]": [NAN, 8, 8, NAN],
        "scan.ranges[2]": [NAN, 4, 4, NAN],
        "robot/state.docked": [NAN, NAN, 0, 1],
        "robot/state.bumpers[1]": [NAN, NAN, 1, 2],
        "robot/state.charge": [NAN, NAN, 1, 2],
    }
    for name, values in expected.items():
        assert np.array_equal(log[name].astype(float), values, equal_nan=True), name
    assert log["mode.data"].tolist() == ["search", "search", "search", "follow"]
    assert log.actuators == ["cmd_vel.linear.x", "cmd_vel.angular.z"]
    assert log.sensors == [
        "scan.range_min", "scan.range_max", "scan.ranges[0]", "scan.ranges[1]", "scan.ranges[2]",
        "robot/state.docked", "robot/state.bumpers[0]", "robot/state.bumpers[1]", "robot/state.charge", "mode.data",
    ]  # fmt: skip
    assert log.rate == pytest.approx(10)
    assert log.episodes is None
    assert log.units["cmd_vel.linear.x"] == "m/s"
    assert log.units["cmd_vel.angular.z"] == "rad/s"
    assert log.units["scan.ranges[2]"] == "m"
    assert log.ranges == {f"scan.ranges[{place}]": (0.125, 8) for place in range(3)}
    assert log.left_out == {
        "/camera/image": "sensor_msgs/msg/Image: images are not read",
        "robot/state.faults": "it is an array of texts",
        "robot/state.path": "it is an array of messages",
        "robot/state.map": "it is an array of 5,000 numbers",
        **{f"cmd_vel.{name}": "it is always 0" for name in ("linear.y", "linear.z", "angular.x", "angular.y")},
    }


def test_from_a_recording_to_demonstrations(tmp_path: Path) -> None:
    log = read_mcap(write(tmp_path / "run.mcap"))
    schema = Schema.from_data(log)
    changing = ["scan.ranges[0]", "robot/state.docked", "robot/state.bumpers[1]", "robot/state.charge", "mode.data"]
    assert [sensor.name for sensor in schema.sensors] == changing
    assert (schema.sensors[0].low, schema.sensors[0].high, schema.sensors[0].unit) == (0.125, 8, "m")
    shown = Demonstrations.from_data(log, schema)
    assert shown.commands[:, 1].tolist() == [0, -1, 1, 0.5]
    assert shown.units["cmd_vel.linear.x"] == "m/s"


def test_named_topics_alone_are_read(tmp_path: Path) -> None:
    path = write(tmp_path / "run.mcap")
    log = read_mcap(path, ["/mode", "/cmd_vel"])
    assert log.sensors == ["mode.data"]
    assert log.left_out["/scan"] == "not among the topics that were named"
    log = read_mcap(path, ["/scan", "/robot/state"], commands="/robot/state")
    assert log.actuators == ["robot/state.docked", "robot/state.bumpers[1]", "robot/state.charge"]
    assert np.array_equal(log["scan.ranges[0]"], [3, 0.125])


def test_a_bag_is_read_in_the_order_of_its_files(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    order = sorted(MESSAGES, key=lambda message: message[2])
    for number, part in ((9, order[:5]), (10, order[5:])):
        write(folder / f"bag_{number}.mcap", part)
    whole, split = read(write(tmp_path / "run.mcap")), read(folder)
    assert sorted(split.columns) == sorted(whole.columns)
    for name in whole.columns:
        if name != "mode.data":
            assert np.array_equal(whole[name].astype(float), split[name].astype(float), equal_nan=True), name
    assert split["mode.data"].tolist() == whole["mode.data"].tolist()


def foreign(path: Path) -> None:
    with path.open("wb") as file:
        writer = PlainWriter(file)
        writer.start("", "test")
        schema = writer.register_schema("Pose", "jsonschema", b"{}")
        channel = writer.register_channel("/pose", "json", schema)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()


def shortened(path: Path) -> None:
    path.write_bytes(write(path).read_bytes()[:-200])


def damaged(path: Path) -> None:
    content = bytearray(write(path).read_bytes())
    content[300] ^= 255  # in the compressed messages
    path.write_bytes(content)


def other_twist(path: Path) -> None:
    write(path, [*MESSAGES, ("/teleop", TWIST, 5, twist(1, 1))])


@pytest.mark.parametrize(
    ("make", "options", "why"),
    [
        (write, {"topics": ["/scna", "/cmd_vel"]}, "topic '/scna' cannot be read; there are /cmd_vel"),
        (write, {"topics": ["/camera/image", "/cmd_vel"]}, "'/camera/image' cannot be read: .*: images are not read"),
        (write, {"topics": ["/scan"], "commands": "/cmd_vel"}, "'/cmd_vel' cannot be read: not among the topics"),
        (write, {"topics": ["/scan"]}, r"no topic is known for the commands: name .*; the topics are /scan \(sensor_m"),
        (write, {"topics": ["/cmd_vel"]}, "no other topic than /cmd_vel has numbers"),
        (write, {"commands": "/mode"}, "no number of /mode ever changes"),
        (other_twist, {}, "several topics could be the commands: name one"),
        (foreign, {}, "the topics are none that can be read"),
        (foreign, {"topics": ["/pose"]}, "'/pose' cannot be read: Pose: its messages are encoded as json, jsonschema"),
        (shortened, {}, "is no readable MCAP file of ROS 2"),
        (damaged, {}, "is no readable MCAP file of ROS 2"),
        (lambda path: path.write_text("front,v"), {}, "is no readable MCAP file of ROS 2"),
    ],
)
def test_mistakes_take_one_line(make: Callable[[Path], Any], options: dict[str, Any], why: str, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    make(path)
    with pytest.raises(ValueError, match=why) as caught:
        read_mcap(path, **options)
    assert "\n" not in str(caught.value)
    assert "run.mcap" in str(caught.value)
