"""If-else rules like those of the corral's teacher, with thresholds that can be drawn."""

from dataclasses import dataclass
from typing import Any

import torch

from behaviours import Actuator, BehaviourBank, Demonstrations, ErrorDriven, Schema, Sensor, Space
from torchvsa import MAP
from torchvsa.encoders import Level, Product

SCHEMA = Schema(
    [Sensor("light_left", 0, 4, "m"), Sensor("light_right", 0, 4, "m"), Sensor("distance", 0, 0.6, "m")],
    [Actuator("left_motor", -1, 1, levels=3), Actuator("right_motor", -1, 1, levels=3)],
)


@dataclass(frozen=True)
class Rules:
    """Turn to the light, away from obstacles, else drive straight on."""

    light_below: float = 2.6
    obstacle_below: float = 0.22
    turn: int = 1
    """1 to turn toward the light, -1 to turn away from it."""

    def __call__(self, readings: Any) -> torch.Tensor:
        left, right, distance = torch.as_tensor(readings).unbind(1)
        lit_left, lit_right = left < self.light_below, right < self.light_below
        turn = torch.where(distance < self.obstacle_below, -1, 0) * ~(lit_left | lit_right)
        turn = torch.where(lit_left & ~lit_right, -self.turn, torch.where(lit_right & ~lit_left, self.turn, turn))
        return torch.stack([torch.where(turn < 0, -1, 1), torch.where(turn > 0, -1, 1)], 1).double()


def readings(count: int, seed: int = 0) -> torch.Tensor:
    """Random readings `[count, 3]`."""
    unit = torch.rand(count, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return unit * torch.tensor([4.0, 4.0, 0.6])


def variants(count: int, seed: int = 0) -> list[Rules]:
    """Rules with random thresholds."""
    drawn = torch.rand(count, 2, generator=torch.Generator().manual_seed(seed)).tolist()
    return [Rules(1 + 2.5 * light, 0.1 + 0.4 * near) for light, near in drawn]


def space(bins: int = 16, dim: int = 2000, seed: int = 0) -> Space:
    return Space(SCHEMA, Product(Level(MAP(dim, dtype=torch.int8), bins), 3), seed=seed)


def learned(rules: dict[str, Rules], shown: int = 300, **options: Any) -> BehaviourBank:
    """A trained behaviour for each of the rules, all shown the same readings."""
    bank = BehaviourBank(space(**options))
    x = readings(shown)
    for name, rule in rules.items():
        bank.learn(name, Demonstrations(x, rule(x)), ErrorDriven())
    return bank
