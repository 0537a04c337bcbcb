"""What can come between a robot's sensors and its program. Every disturbance is drawn from (seed, episode) alone.

A disturbance maps true readings `[B, n]` to disturbed ones, step by step and with an explicit state, as a controller
maps readings to commands (see `sim.Controller`): an episode is disturbed in the same way whatever else is in the batch.
Strength 0 changes nothing.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

import sim
from experiments.models import draws
from sim.controller import as_controller

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

NAMES = [sensor.name for sensor in sim.SENSORS]
LOW = np.array([sensor.low for sensor in sim.SENSORS])
HIGH = np.array([sensor.high for sensor in sim.SENSORS])

STUCK_WITHIN = 10.0
"""A sensor that gets stuck does so within this time from the start, s: about as long as a run of the teacher takes."""


class Disturbance(ABC):
    """One way of disturbing sensors, at one strength; listed in `DISTURBANCES`."""

    name: ClassVar[str]
    axis: ClassVar[str]
    """What strength means, with its unit."""
    gaps: ClassVar[bool] = False
    """Whether readings go missing and come back, so that the last that arrived can replace them."""

    def __init__(self, strength: float, seed: int) -> None:
        self.strength, self.seed = strength, seed

    @classmethod
    def label(cls, strength: float) -> str:
        """The strength in words."""
        return f"{strength:g}"

    def start(self, episodes: Integers) -> Any:
        """The state at the beginning of these episodes `[B]`."""
        return None if self.strength == 0 else self.begin(episodes)

    def step(self, readings: Floats, state: Any) -> tuple[Floats, Any]:
        """The disturbed readings `[B, n]`, NaN where nothing arrives, and the next state."""
        return (readings.copy(), state) if self.strength == 0 else self.disturb(readings, state)

    def begin(self, episodes: Integers) -> Any:
        """The state of a strength above 0: none, unless a subclass has one."""
        return None

    @abstractmethod
    def disturb(self, readings: Floats, state: Any) -> tuple[Floats, Any]:
        """One step at a strength above 0."""

    def seed_of(self, episode: int) -> list[int]:
        """The seed of an episode's random numbers."""
        # The name is part of the seed, so that two disturbances of a run do not strike at the same steps.
        return [self.seed, episode, *self.name.encode()]


class _Drawn(Disturbance):
    """A disturbance with fresh random numbers for each sensor and step, which `draw` draws for a number of steps."""

    draw: draws.Draw

    def begin(self, episodes: Integers) -> draws.Drawn:
        """Random numbers for each episode."""
        return draws.start([self.seed_of(episode) for episode in episodes.tolist()], self.draw)

    def disturb(self, readings: Floats, state: draws.Drawn) -> tuple[Floats, draws.Drawn]:
        """Disturbed by the next random numbers."""
        numbers, state = draws.step(state, self.draw)
        return self.disturbed(readings, numbers), state

    @abstractmethod
    def disturbed(self, readings: Floats, numbers: Floats) -> Floats:
        """Readings `[B, n]` disturbed by random numbers `[B, n]`."""


def _uniform(generator: np.random.Generator, rows: int) -> Floats:
    return generator.uniform(size=(rows, len(NAMES)))


def _normal(generator: np.random.Generator, rows: int) -> Floats:
    return generator.standard_normal((rows, len(NAMES)))


class Missing(_Drawn):
    """Each reading is lost with a probability, at each step anew."""

    name = "missing"
    axis = "share of readings lost"
    gaps = True
    draw = staticmethod(_uniform)

    def disturbed(self, readings: Floats, numbers: Floats) -> Floats:
        """NaN where lost."""
        return np.where(numbers < self.strength, np.nan, readings)


class Noisy(_Drawn):
    """Gaussian noise, its standard deviation a share of each sensor's range; clipped to the range."""

    name = "noisy"
    axis = "noise, share of the sensor's range"
    draw = staticmethod(_normal)

    def disturbed(self, readings: Floats, numbers: Floats) -> Floats:
        """With noise added."""
        return np.clip(readings + self.strength * (HIGH - LOW) * numbers, LOW, HIGH)


class Stuck(Disturbance):
    """Each sensor gets stuck with a probability: from a random step on it repeats what it read then."""

    name = "stuck"
    axis = "share of sensors that get stuck"

    def begin(self, episodes: Integers) -> tuple[Floats, Floats]:
        """The steps left until each sensor gets stuck, and its latest reading, `[B, n]` each."""
        left = np.array([self.onset(episode) for episode in episodes.tolist()])
        return left, np.full_like(left, np.nan)

    def disturb(self, readings: Floats, state: tuple[Floats, Floats]) -> tuple[Floats, tuple[Floats, Floats]]:
        """The present reading of sensors that still work, the last one of those that do not."""
        left, last = state
        readings = np.where(left < 0, last, readings)
        return readings, (left - 1, readings)

    def onset(self, episode: int) -> Floats:
        """The step at which each sensor gets stuck, `[n]`; infinity if it never does."""
        generator = np.random.default_rng(self.seed_of(episode))
        fails = generator.uniform(size=len(NAMES)) < self.strength
        return np.where(fails, generator.integers(0, round(STUCK_WITHIN * sim.CONTROL_HZ), len(NAMES)), np.inf)


class Delayed(Disturbance):
    """Readings arrive some control steps late; until the first one arrives, it replaces those before it."""

    name = "delayed"
    axis = f"delay, control steps of {1000 // sim.CONTROL_HZ} ms"

    def begin(self, episodes: Integers) -> tuple[Flags, Floats]:
        """Whether the episode has only begun `[B]`, and the readings on their way `[B, strength, n]`, oldest first."""
        batch = len(episodes)
        return np.ones(batch, dtype=np.bool_), np.full((batch, int(self.strength), len(NAMES)), np.nan)

    def disturb(self, readings: Floats, state: tuple[Flags, Floats]) -> tuple[Floats, tuple[Flags, Floats]]:
        """The reading `strength` steps before."""
        new, waiting = state
        waiting = np.where(new[:, None, None], readings[:, None], waiting)
        return waiting[:, 0], (np.zeros_like(new), np.concatenate([waiting[:, 1:], readings[:, None]], axis=1))


class Aliased(Disturbance):
    """Sensors are taken away for good, so that states that differ in them look alike."""

    name = "aliased"
    axis = "sensors taken away"
    WITHOUT: ClassVar[tuple[tuple[int, ...], ...]] = ((), (2,), (0,), (1,), (0, 1))
    """The sensors that each strength 0, 1, ... takes away."""

    @classmethod
    def label(cls, strength: float) -> str:
        """The sensors that are gone."""
        return " and ".join(NAMES[i].replace("_", " ") for i in cls.WITHOUT[int(strength)]) or "none"

    def disturb(self, readings: Floats, state: None) -> tuple[Floats, None]:
        """NaN for the sensors that are gone."""
        readings = readings.copy()
        readings[:, list(self.WITHOUT[int(self.strength)])] = np.nan
        return readings, state


DISTURBANCES: dict[str, type[Disturbance]] = {d.name: d for d in (Missing, Stuck, Delayed, Noisy, Aliased)}


class Disturbed:
    """A controller whose sensors are disturbed. Its state is that of the disturbance and that of the controller."""

    def __init__(self, disturbance: Disturbance, controller: sim.ControllerLike) -> None:
        self.disturbance, self.controller = disturbance, as_controller(controller)

    def start(self, episodes: Integers) -> tuple[Any, Any]:
        """See `sim.Controller`."""
        return self.disturbance.start(episodes), self.controller.start(episodes)

    def step(self, readings: Floats, state: tuple[Any, Any]) -> tuple[Any, tuple[Any, Any]]:
        """What the controller answers to the disturbed readings `[B, n]`."""
        readings, disturbance = self.disturbance.step(readings, state[0])
        answer, inner = self.controller.step(readings, state[1])
        return answer, (disturbance, inner)


def disturb_in_turns(disturbances: Sequence[Disturbance], readings: Floats, episodes: Integers) -> Floats:
    """Recorded readings `[N, n]` with the disturbances taking turns, one per episode: the first, the second, ...

    The rows of an episode are its steps from 0 on, in this order.
    """
    _, number = np.unique(episodes, return_inverse=True)
    disturbed = np.empty_like(readings)
    for turn, disturbance in enumerate(disturbances):
        rows = number % len(disturbances) == turn
        if rows.any():
            disturbed[rows] = sim.replay(disturbance, readings[rows], episodes[rows])
    return disturbed
