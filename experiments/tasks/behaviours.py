"""Behaviours that demonstrations are taken apart into: each says in which readings it fires, and what it commands."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

import sim
from behaviours import Demonstrations
from torchvsa.registry import Registry

Floats = NDArray[np.float64]
Rule = Callable[[Floats], tuple[NDArray[np.bool_], Floats]]
"""For readings `[B, n]`: whether it fires, `[B]`, and its commands, `[B, 2]`."""

BEHAVIOURS: Registry[Rule] = Registry("behaviour")
"""All behaviours by name. One of your own is registered here, see docs/plugins.md."""


def _of_teacher(name: str) -> Rule:
    """A behaviour of the teacher: some of its rules."""

    def rule(readings: Floats) -> tuple[NDArray[np.bool_], Floats]:
        teacher = sim.Teacher()
        return np.isin(teacher.rule(readings), sim.BEHAVIOURS[name]), teacher(readings)

    return rule


for _name in sim.BEHAVIOURS:
    BEHAVIOURS.register(_name, _of_teacher(_name))


class Precedence:
    """Drives with the first of several behaviours that fires, and stops where none does."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = list(names)

    def first(self, readings: Floats) -> NDArray[np.int64]:
        """The index of the behaviour that fires, their number where none does, `[B]`."""
        fires = [BEHAVIOURS.find(name)(readings)[0] for name in self.names]
        return np.argmax([*fires, np.ones(len(readings), dtype=np.bool_)], axis=0)

    def __call__(self, readings: Floats) -> Floats:
        """Commands `[B, 2]` for readings `[B, n]`."""
        commands = [BEHAVIOURS.find(name)(readings)[1] for name in self.names]
        every = np.stack([*commands, np.zeros((len(readings), len(sim.ACTUATORS)))])
        return every[self.first(readings), np.arange(len(readings))]

    def apart(self, shown: Demonstrations) -> dict[str, Demonstrations]:
        """The samples in which each behaviour fires first. Raises `ValueError` for one without any."""
        first = self.first(shown.sensors.numpy())
        for number, name in enumerate(self.names):
            if not (first == number).any():
                raise ValueError(f"no demonstration shows {name!r}; give more of them (demonstrations=...)")
        return {name: shown.where(first == number) for number, name in enumerate(self.names)}
