"""What a program still recalls, for every rule that the main job offers."""

import pytest
import torch

from behaviours import RULES, Demonstrations
from experiments.corral.forgetting import recalled
from experiments.kit import parts
from experiments.tasks.corral import schema

VSA = {"name": "MAP-C", "dim": 2000, "dtype": "int8"}


@pytest.mark.parametrize("name", RULES)
def test_any_rule_can_be_compared(name: str) -> None:
    space = parts.space(schema(), VSA, {"name": "level", "bins": 4}, {"name": "product"}, {"name": "none"}, seed=0)
    readings = torch.tensor([[low, high, 0.5] for low in (0.5, 2.0, 3.5) for high in (0.5, 2.0, 3.5)])
    commands = torch.sign(readings[:, :2] - 2)
    found = recalled({name: (space, parts.rule({"name": name}))}, Demonstrations(readings, commands))
    assert set(found.conditions) == {9}
    assert found[name].to_numpy().mean() > 0.8
