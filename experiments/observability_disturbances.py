"""What can come between a robot's sensors and its program. Every disturbance is drawn from (seed, episode) alone.

A disturbance is a function of the true readings `[B, n]` of some `episodes` `[B]` at some `steps` `[B]`, as a policy
of the simulator is: an episode is disturbed in the same way whatever else is in the batch. Strength 0 changes
nothing. Steps of an episode are asked for in order, from 0 on.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

import sim

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

NAMES = [name for name, *_ in sim.SENSORS]
LOW = np.array([low for _, low, _, _ in sim.SENSORS])
HIGH = np.array([high for _, _, high, _ in sim.SENSORS])

STUCK_WITHIN = 10.0
"""A sensor that gets stuck does so within this time from the start, s: about as long as a run of the teacher takes."""


class Disturbance(ABC):
    """One way of disturbing sensors, at one strength; listed in `DISTURBANCES`."""

    name: ClassVar[str]
    axis: ClassVar[str]
    """What strength means, with its unit."""
    gaps: ClassVar[bool] = False
    """Whether readings go missing and come back, so that the last that arrived can stand for them."""

    def __init__(self, strength: float, seed: int) -> None:
        self.strength, self.seed = strength, seed
        self.check(strength)
        self._kept: dict[int, Floats] = {}

    @classmethod
    def check(cls, strength: float) -> None:
        """Raise `ValueError` for a strength that has no meaning: here, unless it is a probability."""
        if not 0 <= strength <= 1:
            raise ValueError(f"{cls.name}: strength is a {cls.axis}, from 0 to 1; got {strength:g}")

    @classmethod
    def label(cls, strength: float) -> str:
        """The strength in words."""
        return f"{strength:g}"

    def __call__(self, readings: Floats, episodes: Integers, steps: Integers) -> Floats:
        """The disturbed readings `[B, n]`; NaN where nothing arrives."""
        if self.strength == 0:
            return readings.copy()
        rows = zip(readings, episodes.tolist(), steps.tolist(), strict=True)
        return np.array([self.disturb(*row) for row in rows]).reshape(readings.shape)

    @abstractmethod
    def disturb(self, row: Floats, episode: int, step: int) -> Floats:
        """The disturbed reading `[n]` of one robot."""

    def draw(self, episode: int, rows: int) -> tuple[np.random.Generator, int]:
        """An episode's own generator, and how many rows to draw from it."""
        # The name is part of the seed, so that two disturbances of a run do not strike at the same steps.
        return np.random.default_rng([self.seed, episode, *self.name.encode()]), rows


class _Drawn(Disturbance):
    """A disturbance with fresh random numbers for each sensor and step."""

    def numbers(self, episode: int, step: int) -> Floats:
        """The random numbers `[n]` of one step."""
        table = self._kept.get(episode)
        if table is None or step >= len(table):
            # A longer draw from the same generator begins with the shorter one.
            generator, rows = self.draw(episode, max(1200, 2 * step))
            table = self._kept[episode] = self.table(generator, rows)
        return table[step]

    @abstractmethod
    def table(self, generator: np.random.Generator, rows: int) -> Floats:
        """Random numbers `[rows, n]`."""


class Missing(_Drawn):
    """Each reading is lost with a probability, at each step anew."""

    name = "missing"
    axis = "share of readings lost"
    gaps = True

    def table(self, generator: np.random.Generator, rows: int) -> Floats:
        """Uniform in [0, 1)."""
        return generator.uniform(size=(rows, len(NAMES)))

    def disturb(self, row: Floats, episode: int, step: int) -> Floats:
        """NaN where lost."""
        return np.where(self.numbers(episode, step) < self.strength, np.nan, row)


class Noisy(_Drawn):
    """Gaussian noise, its standard deviation a share of each sensor's range; clipped to the range."""

    name = "noisy"
    axis = "noise, share of the sensor's range"

    def table(self, generator: np.random.Generator, rows: int) -> Floats:
        """Standard normal."""
        return generator.standard_normal((rows, len(NAMES)))

    def disturb(self, row: Floats, episode: int, step: int) -> Floats:
        """With noise added."""
        return np.clip(row + self.strength * (HIGH - LOW) * self.numbers(episode, step), LOW, HIGH)


class Stuck(Disturbance):
    """Each sensor gets stuck with a probability: from a random step on it repeats what it read then."""

    name = "stuck"
    axis = "share of sensors that get stuck"

    def __init__(self, strength: float, seed: int) -> None:
        super().__init__(strength, seed)
        self._onsets: dict[int, Floats] = {}

    def disturb(self, row: Floats, episode: int, step: int) -> Floats:
        """The latest reading of sensors that still work, the last one of those that do not."""
        if step == 0:
            self._onsets[episode] = self.onset(episode)
        row = row.copy() if step == 0 else np.where(step > self._onsets[episode], self._kept[episode], row)
        self._kept[episode] = row
        return row

    def onset(self, episode: int) -> Floats:
        """The step at which each sensor gets stuck, `[n]`; infinity if it never does."""
        generator, sensors = self.draw(episode, len(NAMES))
        fails = generator.uniform(size=sensors) < self.strength
        return np.where(fails, generator.integers(0, round(STUCK_WITHIN * sim.CONTROL_HZ), sensors), np.inf)


class Delayed(Disturbance):
    """Readings arrive some control steps late; until the first arrives, it stands for what came before."""

    name = "delayed"
    axis = f"delay, control steps of {1000 // sim.CONTROL_HZ} ms"

    @classmethod
    def check(cls, strength: float) -> None:
        """Raise `ValueError` unless the strength is a whole number of steps."""
        if strength < 0 or strength != int(strength):
            raise ValueError(f"{cls.name}: strength is a whole number of control steps; got {strength:g}")

    def disturb(self, row: Floats, episode: int, step: int) -> Floats:
        """The reading `strength` steps before."""
        waiting = np.repeat(row[None], int(self.strength), 0) if step == 0 else self._kept[episode]
        self._kept[episode] = np.concatenate([waiting[1:], row[None]])
        return waiting[0]


class Aliased(Disturbance):
    """Sensors are taken away for good, so that states that differ in them look alike."""

    name = "aliased"
    axis = "sensors taken away"
    WITHOUT: ClassVar[tuple[tuple[int, ...], ...]] = ((), (2,), (0,), (1,), (0, 1))
    """The sensors that each strength 0, 1, ... takes away."""

    @classmethod
    def check(cls, strength: float) -> None:
        """Raise `ValueError` unless the strength is an index into `WITHOUT`."""
        if strength not in range(len(cls.WITHOUT)):
            choices = ", ".join(f"{i}: {cls.label(i)}" for i in range(len(cls.WITHOUT)))
            raise ValueError(f"{cls.name}: strength is one of {choices}; got {strength:g}")

    @classmethod
    def label(cls, strength: float) -> str:
        """The sensors that are gone."""
        return " and ".join(NAMES[i].replace("_", " ") for i in cls.WITHOUT[int(strength)]) or "none"

    def disturb(self, row: Floats, episode: int, step: int) -> Floats:
        """NaN for the sensors that are gone."""
        row = row.copy()
        row[list(self.WITHOUT[int(self.strength)])] = np.nan
        return row


DISTURBANCES: dict[str, type[Disturbance]] = {d.name: d for d in (Missing, Stuck, Delayed, Noisy, Aliased)}


def mixed(disturbances: Sequence[Disturbance], readings: Floats, episodes: Integers, steps: Integers) -> Floats:
    """The same with the disturbances taking turns, one an episode: the first, the second, ..."""
    _, turn = np.unique(episodes, return_inverse=True)
    result = np.empty_like(readings)
    for index, disturbance in enumerate(disturbances):
        own = turn % len(disturbances) == index
        result[own] = disturbance(readings[own], episodes[own], steps[own])
    return result
