"""What a program still recalls, for every rule that the main job offers."""

from typing import Any

import pytest
import torch

from behaviours import RULES, Demonstrations
from experiments import presets
from experiments.forgetting import recalled


@pytest.mark.parametrize("name", RULES)
def test_any_rule_can_be_compared(name: str) -> None:
    parts: dict[str, Any] = {
        "encoder": {"bins": 4, "values": "level"},
        "record": {"combine": "bind"},
        "protection": {"name": "none"},
    }
    space = presets.space({"name": "MAP-C", "dim": 2000, "dtype": "int8"}, parts, seed=0)
    readings = torch.tensor([[low, high, 0.5] for low in (0.5, 2.0, 3.5) for high in (0.5, 2.0, 3.5)])
    commands = torch.sign(readings[:, :2] - 2)
    found = recalled({name: (space, presets.rule({"name": name}))}, Demonstrations(readings, commands))
    assert found.conditions == 9
    assert found.share(name) > 0.8
