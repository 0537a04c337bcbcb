"""A ROS 2 node that drives with a behaviour: range sensors in, `/cmd_vel` out, 50 times a second.

    python examples/ros2_node.py bank.safetensors drive /light_left /light_right /front

The topics carry `sensor_msgs/Range`, one for each sensor of the bank, in its order. Its actuators are `left_motor` and
`right_motor` in [-1, 1]. A sensor that has not reported for 0.2 s counts as not observed; without any, and where the
answer is not sure, the robot stops. Latency and memory are those of `control_loop.py`.
"""

import argparse
import math
import time

import rclpy
import torch
from geometry_msgs.msg import Twist
from rclpy.node import Node
from sensor_msgs.msg import Range

from behaviours import BehaviourBank

HERTZ, STALE = 50.0, 0.2
SPEED, TRACK = 0.4, 0.2
"""Speed of a wheel at full command, m/s, and distance between the wheels, m."""


class Driver(Node):
    """Asks the behaviour with the latest readings at a fixed rate."""

    def __init__(self, bank: str, name: str, topics: list[str], margin: float = 0.01) -> None:
        super().__init__("behaviour")
        self.tick = BehaviourBank.load(bank)[name].freeze()
        sensors = self.tick.space.schema.sensors
        if len(topics) != len(sensors):
            raise ValueError(f"{name} has the sensors {[s.name for s in sensors]}; got the topics {topics}")
        self.margin = margin
        self.readings, self.seen = [math.nan] * len(topics), [-math.inf] * len(topics)
        for place, topic in enumerate(topics):
            self.create_subscription(Range, topic, lambda message, place=place: self.heard(place, message.range), 1)
        self.commands = self.create_publisher(Twist, "/cmd_vel", 1)
        self.create_timer(1 / HERTZ, self.drive)

    def heard(self, place: int, reading: float) -> None:
        """Keep the latest reading of a sensor."""
        self.readings[place], self.seen[place] = reading, time.monotonic()

    def drive(self) -> None:
        """Publish the answer to the latest readings."""
        now, message = time.monotonic(), Twist()
        current = [
            reading if now - seen < STALE else math.nan for reading, seen in zip(self.readings, self.seen, strict=True)
        ]
        recall = self.tick([current])
        left, right = recall.commands[0].tolist()
        if not math.isnan(left) and recall.margin.item() >= self.margin:
            message.linear.x = SPEED * (left + right) / 2
            message.angular.z = SPEED * (right - left) / TRACK
        self.commands.publish(message)


def main() -> None:
    """Spin until ROS shuts down."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("bank")
    options.add_argument("name")
    options.add_argument("topics", nargs="+")
    given, others = options.parse_known_args()
    torch.set_num_threads(1)
    rclpy.init(args=others)
    node = Driver(given.bank, given.name, given.topics)
    try:
        rclpy.spin(node)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
