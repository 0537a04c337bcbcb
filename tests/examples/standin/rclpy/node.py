"""A node that keeps its subscriptions, timers and what it published."""

from collections.abc import Callable
from typing import Any


class Node:
    def __init__(self, name: str) -> None:
        self.name = name
        self.subscriptions: list[tuple[str, Callable[[Any], None]]] = []
        self.timers: list[tuple[float, Callable[[], None]]] = []
        self.published: list[Any] = []

    def create_subscription(self, kind: type, topic: str, call: Callable[[Any], None], depth: int) -> None:
        self.subscriptions.append((topic, call))

    def create_publisher(self, kind: type, topic: str, depth: int) -> "Node":
        return self

    def publish(self, message: Any) -> None:
        self.published.append(message)

    def create_timer(self, period: float, call: Callable[[], None]) -> None:
        self.timers.append((period, call))

    def destroy_node(self) -> None:
        pass
