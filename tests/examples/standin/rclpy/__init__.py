"""Stands in for ROS 2 in tests: topics are calls, and a timer fires as often as it is told."""

from typing import Any

NODES: list[Any] = []
SPINS = 5


def init(args: object = None) -> None:
    """Nothing to start."""


def spin(node: Any) -> None:
    """Publish readings, then let every timer fire; at last without any new reading."""
    from sensor_msgs.msg import Range

    for turn in range(SPINS):
        for place, (_, call) in enumerate(node.subscriptions):
            call(Range(range=0.1 * (turn + place)))
        for _, call in node.timers:
            call()
    node.seen[:] = [-1e9] * len(node.seen)
    for _, call in node.timers:
        call()
    for message in node.published:
        print(f"{message.linear.x:.3f} {message.angular.z:.3f}")


def try_shutdown() -> None:
    """Nothing to stop."""
