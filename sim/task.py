"""What a robot senses, and which lamps it has to reach."""

from __future__ import annotations

from dataclasses import dataclass

from sim.arena import Arena
from sim.channel import Channel
from sim.sensors import DISTANCE_MAX, LIGHT_MAX


@dataclass(frozen=True)
class Task:
    """The sensors and the goals of a robot in an arena.

    Attributes:
        lights: colours of light that the robot senses, each with a pair of sensors, left and right.
        goals: colours of lamps to touch, in this order; the robot has to stay at the last one.
    """

    lights: tuple[str, ...] = ("yellow",)
    goals: tuple[str, ...] = ("yellow",)

    def __post_init__(self) -> None:
        if len(set(self.lights)) < len(self.lights) or not self.goals:
            raise ValueError(f"{self}; expected each light once, and at least one goal")

    @classmethod
    def of(cls, arena: Arena) -> Task:
        """Sense all colours of an arena's lamps, and go to its lamps in their order."""
        goals = tuple(lamp.colour for lamp in arena.lamps)
        return cls(tuple(dict.fromkeys(goals)), goals)

    def check(self, arena: Arena) -> None:
        """Raise `ValueError` for a goal that the arena does not have."""
        colours = {lamp.colour for lamp in arena.lamps}
        for goal in self.goals:
            if goal not in colours:
                raise ValueError(f"the arena has no {goal} lamp; choose goals from {', '.join(sorted(colours))}")

    @property
    def sensors(self) -> tuple[Channel, ...]:
        """The readings, in order: a pair for each light, then the distance. See `sim.sensors`."""
        prefixes = ["light"] if len(self.lights) == 1 else list(self.lights)
        lights = (Channel(f"{prefix}_{side}", 0.0, LIGHT_MAX, "m") for prefix in prefixes for side in ("left", "right"))
        return (*lights, Channel("distance", 0.0, DISTANCE_MAX, "m"))

    def pair(self, colour: str) -> tuple[int, int]:
        """The columns of the readings, left and right, of a light. Raises `ValueError` for one that is not sensed."""
        if colour not in self.lights:
            raise ValueError(f"{colour} light is not sensed; choose from {', '.join(self.lights)}")
        first = 2 * self.lights.index(colour)
        return first, first + 1


def find_task(task: Task | None, arena: Arena) -> Task:
    """A task, by default `Task.of(arena)`. Raises `ValueError` for a goal that the arena does not have."""
    found = Task.of(arena) if task is None else task
    found.check(arena)
    return found


SENSORS = Task().sensors
"""The readings of a robot that senses one light, in order."""
