"""For which readings a behaviour gives a command: what is named is what the behaviour answers."""

import math
from typing import Any

import pytest
import torch
from if_else import SCHEMA, Rules, readings

from behaviours import Actuator, Demonstrations, ErrorDriven, OneShot, Schema, Sensor, Space, explain_command
from torchvsa import FHRR, HRR, MAP, SelfShift
from torchvsa.encoders import FractionalPower, Level, Lookup, Product, Sum

X = readings(60)
SHOWN = Demonstrations(X, Rules()(X))
VSA = MAP(4000, dtype=torch.int8)
SPACE = Space(SCHEMA, Product(Level(VSA, 16, span=2), 3))
TURN = (-1.0, 1.0)


@pytest.fixture(scope="module", params=[OneShot, ErrorDriven])
def learned(request: pytest.FixtureRequest) -> Any:
    return request.param().fit(SPACE, SHOWN)


def test_every_reading_of_a_rule_gives_the_command(learned: Any) -> None:
    found = explain_command(learned, TURN)
    gives = (learned(X).commands == torch.tensor(TURN)).all(1)
    assert found.right.double().mean() > 0.9
    assert found.covers(X)[gives].double().mean() > 0.85
    asked = readings(3000, seed=7)
    covered = asked[found.covers(asked)]
    assert len(covered) > 30
    assert (learned(covered).commands == torch.tensor(TURN)).all()
    strengths = [rule.strength for rule in found.rules]
    assert strengths == sorted(strengths, reverse=True)


def test_the_plain_search_misses_none() -> None:
    learned = ErrorDriven().fit(Space(SCHEMA, Product(Level(MAP(500, dtype=torch.int8), 8), 3)), SHOWN)
    found = explain_command(learned, TURN, "table", most=10**6)
    asked = readings(3000, seed=7)
    gives = (learned(asked).commands == torch.tensor(TURN)).all(1)
    assert torch.equal(found.covers(asked), gives)
    grid = (torch.cartesian_prod(*[torch.arange(8)] * 3) + 0.5) / 8 * torch.tensor([4.0, 4.0, 0.6])
    assert len(found.found) == int((learned(grid).commands == torch.tensor(TURN)).all(1).sum())


def test_a_taught_rule_is_said_in_a_sentence() -> None:
    schema = Schema(
        [Sensor("distance", 0, 8, "m"), Sensor("bumper", kind="binary")], [Actuator("speed", -1, 1, "m/s", levels=2)]
    )
    space = Space(schema, Product([Lookup(VSA, 8), Lookup(VSA, 2)]))
    x = torch.cartesian_prod(torch.arange(8) + 0.5, torch.arange(2.0))
    behaviour = OneShot().fit(space, Demonstrations(x, torch.where((x[:, :1] < 3) | (x[:, 1:] == 1), -1.0, 1.0)))
    for method in ("resonator", "table"):
        found = explain_command(behaviour, [1], method)
        said = "speed = 1 m/s if distance is 3 to 8 m and bumper is 0"
        assert str(found).startswith(said)
        assert len(found.rules) == 1
        assert found.rules[0][:2] == ((3, 0), (8, 0))
        assert found.rules[0].cells == 5
        assert math.isnan(found.rules[0].strength) == (method == "table")
    # Each of the five conditions is taught once, and the codes of the two results are opposite.
    assert explain_command(behaviour, [1]).rules[0].strength == pytest.approx(0.5, abs=0.1)


def test_phases_are_factored_too_and_the_seed_decides() -> None:
    behaviour = OneShot().fit(Space(SCHEMA, Product(Lookup(FHRR(600), 8), 3)), SHOWN.where(torch.arange(60) < 20))
    found, again = (explain_command(behaviour, TURN, most=3, seed=3) for _ in range(2))
    assert found.right.all()
    assert len(found.found) > 1
    assert found.rules == again.rules


@pytest.mark.parametrize(
    ("encoder", "options", "words"),
    [
        (Product(FractionalPower(HRR(200)), 3), {}, "only records with bins"),
        (Sum(Lookup(MAP(200), 4), 3), {}, "method='table' asks every cell instead"),
        (Product(Lookup(HRR(200), 4), 3), {}, "MAP, BSC or FHRR"),
        (Product(Lookup(MAP(200), 4), 3), {"protection": SelfShift(MAP(200))}, "behind a fixed shift"),
        (Product(Lookup(MAP(200), 4), 3), {"method": "guess"}, "'resonator' or 'table'; got 'guess'"),
        (Product(Lookup(MAP(200), 4), 3), {"commands": [0, 0]}, "none of the"),
        (Product(Lookup(MAP(200), 128), 3), {"method": "table"}, "this space has 2,097,152"),
    ],
)
def test_what_does_not_suit_is_named(encoder: Any, options: dict[str, Any], words: str) -> None:
    space = Space(SCHEMA, encoder, protection=options.pop("protection", None))
    behaviour = OneShot().fit(space, SHOWN)
    with pytest.raises(ValueError, match=words):
        explain_command(behaviour, options.pop("commands", TURN), **options)
