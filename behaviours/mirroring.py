"""What swaps in the mirror image of a robot, and the codebooks that it needs."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import torch
from jaxtyping import Int64
from torch import Tensor

from behaviours.parts import Actuator, Sensor
from behaviours.schema import Schema
from torchvsa import VSA, FixedShift, Protection, Unprotected
from torchvsa.encoders import Binned, Encoder, Level, Mirrored, Sum
from torchvsa.encoders.mirrored import check_mirrored_dim, mirrored, symmetric

_BINS = 32


class Mirror:
    """The sensors and actuators of a schema that swap in its mirror image.

    Only places are exchanged. A number that changes its sign in a mirror image, such as a heading or the command of a
    steering wheel, cannot be mirrored.

    Args:
        schema: The sensors and actuators.
        names: Names of sensors that swap, and names of actuators that swap, as in `{"light_left": "light_right",
            "left_motor": "right_motor"}`; each name once.

    Raises:
        ValueError: For unknown names, names that occur twice, a sensor that swaps with an actuator, and parts that
            differ in more than their names. At least two sensors must swap.
    """

    def __init__(self, schema: Schema, names: Mapping[str, str]) -> None:
        if not isinstance(names, Mapping):
            raise ValueError(f"mirror maps names to names, as in {{'left': 'right'}}; got {names!r:.80}")
        self.names = dict(names)
        sensors = {sensor.name: column for column, sensor in enumerate(schema.sensors)}
        actuators = {actuator.name: column for column, actuator in enumerate(schema.actuators)}
        _check_names(self.names, sensors, actuators)
        self.sensor_pairs = _pairs(self.names, sensors, schema.sensors)
        self.actuator_pairs = _pairs(self.names, actuators, schema.actuators)
        if not self.sensor_pairs:
            raise ValueError(f"mirror names no sensors that swap; the sensors are {', '.join(sensors)}")
        self._count = len(actuators)

    def exchanged(self, names: Sequence[str]) -> tuple[str, ...]:
        """Each of these names, or the one that it swaps with."""
        other = self.names | {second: first for first, second in self.names.items()}
        return tuple(other.get(name, name) for name in names)

    def swapped(self, levels: Int64[Tensor, "k m"]) -> Int64[Tensor, "k m"]:
        """Rows of one level per actuator, with those of paired actuators exchanged."""
        order = list(range(self._count))
        for first, second in self.actuator_pairs:
            order[first], order[second] = second, first
        return levels[:, order]

    def encoder(self, vsa: VSA, sensors: int) -> Encoder:
        """The default encoder of a mirrored space: a product of level codes."""
        return Mirrored(Level(vsa, _BINS), self.sensor_pairs, sensors)

    def check(self, encoder: Encoder, protection: Protection) -> None:
        """Raise `ValueError` unless conditions are mirrored by these pairs, and results can be."""
        check_mirrored_dim(encoder.vsa)
        wanted = set(map(frozenset, self.sensor_pairs))
        if not isinstance(encoder, Mirrored) or set(map(frozenset, encoder.pairs)) != wanted:
            raise ValueError(
                f"a mirrored space needs an encoder that mirrors its sensors, such as Mirrored(Level(vsa, {_BINS}), "
                f"pairs={list(self.sensor_pairs)}, sensors={encoder.sensors}); got {type(encoder).__name__}"
                + (f" with pairs={list(encoder.pairs)}" if isinstance(encoder, Mirrored) else "")
            )
        if not isinstance(protection, Unprotected | FixedShift):
            raise ValueError(
                f"{type(protection).__name__} does not commute with the rotation that mirrors conditions; a mirrored "
                "space takes Unprotected or FixedShift"
            )
        first_two = set(self.swapped(torch.arange(self._count)[None])[0, :2].tolist())
        if encoder.vsa.breaks_ties and self._count % 2 == 0 and first_two != {0, 1}:
            raise ValueError(
                f"{encoder.vsa.name} lets the first two actuators decide ties: in the schema, first list two actuators "
                "that swap, or two that do not"
            )

    def apply(self, results: Sum) -> None:
        """Give paired actuators mirrored roles, and symmetric ones to all others and to the codes of levels.

        Raises `ValueError` for command codes that are not one hypervector per level.
        """
        if not isinstance(results.value, Binned):
            raise ValueError(
                "a mirrored space needs command codes with one hypervector per level, such as Balanced; got "
                f"{type(results.value).__name__}"
            )
        roles = symmetric(results.roles)
        for first, second in self.actuator_pairs:
            roles[first], roles[second] = results.roles[first], mirrored(results.roles[first])
        results.roles, results.value.codes = roles, symmetric(results.value.codes)
        results.derive()

    def check_applied(self, results: Sum) -> None:
        """Raise `ValueError` unless codebooks are as `apply` leaves them."""
        wanted = copy.deepcopy(results)
        self.apply(wanted)
        if not torch.equal(wanted.roles, results.roles) or not torch.equal(wanted.codes, results.codes):
            raise ValueError("the codes of commands are not mirrored as 'mirror' says")


def _check_names(names: Mapping[str, str], sensors: Mapping[str, int], actuators: Mapping[str, int]) -> None:
    known = {*sensors, *actuators}
    both = [*names, *names.values()]
    for name in both:
        if not isinstance(name, str) or name not in known:
            raise ValueError(
                f"mirror names {name!r}, which is no sensor or actuator; there are {', '.join(sorted(known))}"
            )
        if name in sensors and name in actuators:
            raise ValueError(f"mirror names {name!r}, which is a sensor and an actuator; give them different names")
        if both.count(name) > 1:
            raise ValueError(f"mirror names {name!r} more than once; each part swaps with one other")
    for first, second in names.items():
        if (first in sensors) != (second in sensors):
            raise ValueError(f"mirror swaps {first!r} with {second!r}, but one is a sensor and one an actuator")


def _pairs(names: Mapping[str, str], columns: Mapping[str, int], parts: Any) -> tuple[tuple[int, int], ...]:
    pairs = [(columns[first], columns[second]) for first, second in names.items() if first in columns]
    for pair in pairs:
        first, second = (parts[column] for column in pair)
        if not _alike(first, second):
            raise ValueError(f"mirror swaps {first.name!r} with {second.name!r}, which differ in more than their names")
    return tuple(pairs)


def _alike(first: Sensor | Actuator, second: Sensor | Actuator) -> bool:
    return replace(first, name=second.name) == second
