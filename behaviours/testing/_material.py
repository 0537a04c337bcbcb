"""Spaces, readings and demonstrations for the checks."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from jaxtyping import Float64
from torch import Tensor, nn

from behaviours.controller import Controller
from behaviours.demonstrations import Demonstrations
from behaviours.recall import Recall
from behaviours.schema import Actuator, Schema, Sensor
from behaviours.space import Space
from torchvsa import MAP, SelfShift
from torchvsa.encoders import Lookup, Sum
from torchvsa.testing._laws import require, seeded

_DRAWS = 100
"""Random rows from which unrelated conditions are chosen."""


def default_space() -> Space:
    """An integer space of a robot with 3 sensors of 20 values and 9 results, in which conditions are unrelated."""
    schema = Schema(
        [Sensor(name, 0, 20) for name in ("left", "right", "front")],
        [Actuator(name, -1, 1, levels=3) for name in ("left_motor", "right_motor")],
    )
    vsa = MAP(1000, dtype=torch.int8)
    return Space(schema, Sum(Lookup(vsa, bins=20), sensors=3), protection=SelfShift(vsa, width="sum"))


def readings(space: Space, count: int, seed: int = 0, unobserved: float = 0.0) -> Float64[Tensor, "count n"]:
    """Random readings, of which a fraction `unobserved` is NaN, but never of the first sensor."""
    drawn = torch.rand(count, len(space.schema.sensors), generator=seeded(seed), dtype=torch.float64)
    low = torch.tensor([float(sensor.low) for sensor in space.schema.sensors], dtype=torch.float64)
    high = torch.tensor([float(sensor.high) for sensor in space.schema.sensors], dtype=torch.float64)
    # Rounding could exceed the range.
    rows = torch.minimum(low + drawn * (high - low), high)
    hidden = torch.rand(rows.shape, generator=seeded(seed + 1)) < unobserved
    hidden[:, 0] = False
    return rows.masked_fill(hidden, torch.nan)


def pairs(space: Space, count: int, seed: int = 0) -> Demonstrations:
    """Up to `count` pairs of unrelated conditions and random results, each in its own episode.

    Conditions are unrelated if their similarities are within five standard deviations of chance, 1/√d. There is at
    least one pair, and the first two have the lowest and the highest commands.
    """
    rows = readings(space, _DRAWS, seed)
    conditions = space.encode(space.cells(rows, torch.arange(_DRAWS)))
    chosen: list[int] = []
    for row, condition in enumerate(conditions):
        if not chosen or space.vsa.similarity(condition, conditions[chosen]).abs().max() < 5 / space.vsa.dim**0.5:
            chosen.append(row)
        if len(chosen) == count:
            break
    levels = torch.tensor([actuator.levels for actuator in space.schema.actuators])
    drawn = torch.rand(len(chosen), len(levels), generator=seeded(seed + 2), dtype=torch.float64)
    results = (drawn * levels).long()
    results[0], results[1:2] = 0, levels - 1
    return Demonstrations(rows[chosen], space.schema.command_values(results), torch.arange(len(chosen)))


def walk(space: Space, steps: int, robots: int) -> Float64[Tensor, "steps robots n"]:
    """Readings of several robots over time: readings of `pairs`, random ones, and ones with few observed sensors.

    The last robot observes nothing in the first half of the steps.
    """
    learned = pairs(space, 12).sensors
    count = steps * robots
    index = torch.randint(len(learned), (count,), generator=seeded(3))
    rows = torch.where(torch.rand(count, 1, generator=seeded(4)) < 0.6, learned[index], readings(space, count, 5, 0.4))
    rows[torch.rand(count, generator=seeded(6)) < 0.1] = torch.nan
    sequence = rows.view(steps, robots, -1)
    sequence[: steps // 2, -1] = torch.nan
    return sequence


def first_step(behaviour: Controller, readings: Float64[Tensor, "count n"]) -> Recall:
    """The answer to each row as the first step of an episode, which also works for encoders of past readings."""
    return behaviour.step(readings, behaviour.start(range(len(readings))))[0]


def recalls_all(behaviour: Controller, shown: Demonstrations) -> bool:
    """Whether the commands of all demonstrated readings are recalled; smooth ones up to half a level."""
    commands = first_step(behaviour, shown.sensors).commands.cpu()
    if not getattr(behaviour, "smooth", False):
        return torch.equal(commands, shown.commands)
    schema = behaviour.space.schema
    return torch.equal(schema.command_levels(commands), schema.command_levels(shown.commands))


def bits(tensor: Any) -> Tensor:
    """A tensor as real numbers on the CPU, for comparison."""
    tensor = torch.as_tensor(tensor).detach().cpu().resolve_conj()
    return torch.view_as_real(tensor) if tensor.is_complex() else tensor


def tensors(module: nn.Module) -> dict[str, Tensor]:
    """A copy of the tensors of a module."""
    return {name: bits(tensor).clone() for name, tensor in module.state_dict().items()}


def unchanged(module: nn.Module, before: dict[str, Tensor], what: str) -> None:
    """Raise `AssertionError` unless the tensors of the module are those of `before`."""
    after = tensors(module)
    require(after.keys() == before.keys(), f"{what} has other tensors than before")
    for name, tensor in after.items():
        require(
            tensor.dtype == before[name].dtype and tensor.numpy().tobytes() == before[name].numpy().tobytes(),
            f"{name} of {what} was changed",
        )


@contextmanager
def no_global_random_numbers(seed: int) -> Iterator[None]:
    """Seed PyTorch's global generator, and raise `AssertionError` if the body uses or seeds it."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        before = torch.get_rng_state()
        yield
        require(torch.equal(torch.get_rng_state(), before), "PyTorch's global random numbers are drawn or seeded")
