"""Why a controller answered, and what would have changed the answer."""

import math
from typing import Any

import pytest
import torch
from if_else import SCHEMA, Rules, learned, readings
from robots import random_pairs
from robots import space as other_space

from behaviours import (
    Actuator,
    Behaviour,
    Controller,
    Demonstrations,
    ErrorDriven,
    OneShot,
    Priority,
    Recall,
    Schema,
    Sensor,
    Space,
    explain,
)
from torchvsa import FHRR, MAP
from torchvsa.encoders import FractionalPower, History, Level, Lookup, Product, ThresholdFeatures

BANK = learned({"seek": Rules(), "flee": Rules(turn=-1)}, bins=8)
SEEK = BANK["seek"]
ROWS = torch.cat([readings(12, seed=4), torch.tensor([[1.0, math.nan, 0.3], [math.nan, math.nan, math.nan]])])


def test_it_repeats_the_answer() -> None:
    recall, explanation = SEEK(ROWS), explain(SEEK, ROWS)
    assert torch.equal(explanation.commands.nan_to_num(9), recall.commands.nan_to_num(9))
    assert torch.equal(explanation.margin, recall.margin)
    assert torch.equal(explanation.familiarity, recall.familiarity)
    assert explanation.speaker == ("seek",) * 14
    assert explain(SEEK.freeze(), ROWS[:2]).speaker == ("", "")


def test_each_sensor_is_hidden_in_turn() -> None:
    explanation, before = explain(SEEK, ROWS), SEEK(ROWS)
    for sensor in range(3):
        hidden = ROWS.clone()
        hidden[:, sensor] = math.nan
        after = SEEK(hidden)
        changed = (after.commands != before.commands).any(1) & (torch.arange(14) < 13)
        assert torch.equal(explanation.changed[:, sensor], changed)
        drop = before.margin - torch.where(changed, -after.margin, after.margin)
        assert torch.allclose(explanation.margin_drop[:, sensor], drop, atol=1e-6)
    # What was not observed cannot be missed.
    assert not explanation.changed[12, 1]
    assert explanation.margin_drop[12, 1] == 0


def test_the_nearest_change_changes_the_answer_and_no_smaller_one_does() -> None:
    explanation = explain(SEEK, ROWS)
    middles = (torch.arange(8) + 0.5) / 8
    widths = (4.0, 4.0, 0.6)
    for row in range(13):
        change = explanation.nearest[row]
        assert change is not None
        smallest = math.inf
        for sensor, width in enumerate(widths):
            for value in (middles * width).tolist():
                moved = ROWS[row].clone()
                moved[sensor] = value
                size = abs(value - float(ROWS[row, sensor])) / width
                if size < smallest and (SEEK(moved[None]).commands != SEEK(ROWS[row : row + 1]).commands).any():
                    smallest, wanted = (
                        size,
                        (SCHEMA.sensors[sensor].name, value, SEEK(moved[None]).commands[0].tolist()),
                    )
        assert change.size == pytest.approx(smallest)
        name, value, commands = wanted  # type: ignore[possibly-unbound] (the assertion before says so)
        assert (change.sensor, list(change.commands)) == (name, commands)
        assert change.value == pytest.approx(value, rel=1e-6)
    assert explanation.nearest[13] is None


def test_a_sensor_that_decides_alone_is_named() -> None:
    schema = Schema([Sensor("light", 0, 4, "m"), Sensor("noise", 0, 1)], [Actuator("speed", -1, 1, "m/s", levels=2)])
    x = torch.cartesian_prod(torch.arange(8) / 2 + 0.25, torch.arange(8) / 8 + 1 / 16)
    commands = torch.where(x[:, :1] < 2, 1.0, -1.0)
    behaviour = ErrorDriven().fit(
        Space(schema, Product(Level(MAP(1000, dtype=torch.int8), 8), 2)), Demonstrations(x, commands)
    )
    explanation = explain(behaviour, [[1.3, 0.4]])
    change = explanation.nearest[0]
    assert change is not None
    assert (change.sensor, change.value, change.commands) == ("light", 2.25, (-1.0,))
    assert change.size == pytest.approx(0.95 / 4)
    text = str(explanation)
    assert text.startswith("light = 1.3 m and noise = 0.4: speed = 1 m/s.\n")
    assert "Nearest change: light = 2.25 m (24 % of its range away) would give speed = -1 m/s." in text


def test_rows_and_texts() -> None:
    explanation = explain(SEEK, ROWS)
    assert len(explanation) == 14
    one = explanation[2]
    assert len(one) == 1
    assert torch.equal(one.readings, ROWS[2:3])
    assert one.nearest == explanation.nearest[2:3]
    assert str(one) == str(explanation).split("\n\n")[2]
    assert str(explanation[-1]) == "No sensor was observed, so that there is no command."
    assert "light_right not observed" in str(explanation[12])
    assert "seek answered with a margin of" in str(one)
    with pytest.raises(IndexError):
        explanation[14]


def test_policies_name_who_spoke() -> None:
    policy = Priority(BANK, ["flee", "seek"], {"flee": 2, "seek": -1})
    explanation = explain(policy, ROWS)
    assert explanation.speaker == ("seek",) * 13 + ("",)
    assert torch.equal(explanation.commands.nan_to_num(9), policy(ROWS).commands.nan_to_num(9))


def test_one_result_never_changes() -> None:
    behaviour = OneShot().fit(BANK.space, Demonstrations([[1.0, 1.0, 0.1]], [[1, -1]]))
    explanation = explain(behaviour, [[1.0, 1.0, 0.1]])
    assert explanation.nearest == (None,)
    assert not explanation.changed.any()
    assert (explanation.margin_drop == 0).all()
    assert "The answer has a margin of inf" in str(explanation)
    assert "The answer is the same without any one of the sensors." in str(explanation)
    assert "No change of a single reading would change it." in str(explanation)


def mixed(encoder: Any) -> Behaviour:
    schema = Schema(
        [
            Sensor("heading", -180, 180, "deg", kind="angle"),
            Sensor("bumper", kind="binary"),
            Sensor("gear", kind="categorical", values=("low", "high", "reverse")),
        ],
        [Actuator("speed", -1, 1, levels=3)],
    )
    space = Space(schema, encoder, vsa=None if encoder else MAP(1000, dtype=torch.int8))
    rows = [[-170, 0, "low"], [0, 0, "low"], [0, 1, "low"], [0, 0, "reverse"], [90, 0, "low"]]
    return ErrorDriven().fit(space, Demonstrations(rows, [[1], [0], [-1], [-1], [0]], schema=schema))


VSA = MAP(1000, dtype=torch.int8)


@pytest.mark.parametrize("encoder", [None, Product([Level(VSA, 8), Lookup(VSA, 2), Lookup(VSA, 3)])])
def test_other_kinds_of_sensors(encoder: Any) -> None:
    behaviour = mixed(encoder)
    explanation = explain(behaviour, [[170, 0, "low"], [0, 0, "reverse"], [0, 1, "low"]])
    assert "gear = low" in str(explanation[0])
    assert "bumper = 1" in str(explanation[2])
    for row, change in enumerate(explanation.nearest):
        assert change is not None
        column = ["heading", "bumper", "gear"].index(change.sensor)
        moved = explanation.readings[row : row + 1].clone()
        moved[:, column] = change.value
        assert behaviour(moved).commands[0].tolist() == list(change.commands) != explanation.commands[row].tolist()
        assert change.size == 1 if column else change.size <= 0.5
    if explanation.nearest[1].sensor == "gear":  # type: ignore[union-attr] (not None, see above)
        assert "gear = low would" in str(explanation[1]) or "gear = high would" in str(explanation[1])


def test_readings_without_bins_are_tried_on_a_grid() -> None:
    x = readings(60)
    space = Space(SCHEMA, Product(FractionalPower(FHRR(500)), 3))
    behaviour = OneShot().fit(space, Demonstrations(x, Rules()(x)))
    for change in explain(behaviour, x[:4]).nearest:
        assert change is not None
        step = change.value / (0.6 if change.sensor == "distance" else 4) * 63
        assert step == pytest.approx(round(step))


def test_bins_of_given_edges_are_tried() -> None:
    edges = [torch.tensor([0.5]), torch.tensor([]), torch.tensor([0.1, 0.11, 0.9])]
    space = Space(SCHEMA, ThresholdFeatures(VSA, 3, 8, edges=edges))
    x = torch.tensor([[1.0, 1, 0.01], [3, 1, 0.063], [3, 1, 0.3]])
    behaviour = ErrorDriven().fit(space, Demonstrations(x, [[1, 1], [-1, 1], [1, -1]]))
    found = explain(behaviour, [[3, 1, 0.3]]).nearest[0]
    assert found is not None
    assert any(found.value == pytest.approx(value) for value in (1, 0.03, 0.063, 0.57))


class Counting(Controller):
    """Answers by the number of steps."""

    def __init__(self) -> None:
        super().__init__()
        self.space = SEEK.space

    def start(self, episodes: Any) -> Any:
        return torch.zeros(len(episodes))

    def _answer(self, cells: torch.Tensor) -> Recall:
        return SEEK._answer(cells)


def test_controllers_with_a_state_are_refused() -> None:
    vsa = MAP(64)
    made = other_space(64)
    past = Space(made.schema, History(Product(Level(vsa, 8), 3), [1]))
    behaviour = OneShot().fit(past, random_pairs(4))
    for controller in (behaviour, Counting()):
        with pytest.raises(ValueError, match="answers by what it read before"):
            explain(controller, [[1.0, 1.0, 0.1]])
    with pytest.raises(ValueError, match="'distance' reads 7 in row 1"):
        explain(SEEK, [[1.0, 1.0, 0.1], [1.0, 1.0, 7.0]])


def test_no_row_has_no_explanation() -> None:
    empty = explain(SEEK, torch.zeros(0, 3))
    assert len(empty) == 0
    assert str(empty) == ""
