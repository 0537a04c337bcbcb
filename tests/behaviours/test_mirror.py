"""The mirror image of a behaviour: one rotation of its program."""

import copy
import math
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import SCHEMA
from torch.testing import assert_close

import torchvsa
from behaviours import (
    Actuator,
    Behaviour,
    BehaviourBank,
    Demonstrations,
    ErrorDriven,
    Gradient,
    LeastSquares,
    OneShot,
    Schema,
    Sensor,
    Space,
)
from behaviours.learning import Rule
from behaviours.storage import load_tensors, save_tensors
from torchvsa.encoders import FractionalPower, Level, Lookup, Mirrored, Product, ValueEncoder

SWAP = {"left": "right", "left_motor": "right_motor"}
ELEMENTWISE = [name for name in torchvsa.ARCHITECTURES if torchvsa.architecture_near(name, 64).elementwise]
READINGS = torch.rand(40, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64) * 20
COMMANDS = torch.randint(-1, 2, (40, 2), generator=torch.Generator().manual_seed(2)).double()
SHOWN = Demonstrations(READINGS, COMMANDS)
MIRRORED = Demonstrations(READINGS[:, [1, 0, 2]], COMMANDS[:, [1, 0]])


def space(vsa: str = "MAP-C", dim: int = 512, dtype: str | None = None, seed: int = 0, **options: Any) -> Space:
    exact = "int8" if vsa.startswith("MAP") else None
    return Space(SCHEMA, vsa=torchvsa.architecture(vsa, dim, dtype or exact), seed=seed, mirror=SWAP, **options)


def same(a: Behaviour, b: Behaviour) -> bool:
    tensors = zip((a.program, a.known, a.results), (b.program, b.known, b.results), strict=True)
    return all(x.dtype == y.dtype and torch.equal(x, y) for x, y in tensors) and a.report == b.report


@cache
def learned(vsa: str, dtype: str | None, rule: Rule, shift: bool) -> Behaviour:
    architecture = torchvsa.architecture(vsa, 256, dtype or ("int8" if vsa == "MAP-B" else None))
    protection = torchvsa.FixedShift(architecture, 5) if shift else None
    return rule.fit(Space(SCHEMA, vsa=architecture, protection=protection, seed=1, mirror=SWAP), SHOWN)


@pytest.mark.slow
@given(
    readings=st.lists(
        st.lists(st.one_of(st.just(math.nan), st.floats(0, 20)), min_size=3, max_size=3), min_size=1, max_size=5
    ),
    vsa=st.sampled_from(
        [("MAP-C", "int8"), ("MAP-C", "float32"), ("MAP-B", None), ("MAP-I", "float64"), ("BSC", None)]
    ),
    rule=st.sampled_from([OneShot(), ErrorDriven()]),
    shift=st.booleans(),
)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_it_answers_mirrored_readings_with_mirrored_commands(
    readings: list[list[float]], vsa: tuple[str, str | None], rule: Rule, shift: bool
) -> None:
    shown = learned(*vsa, rule, shift)
    x = torch.tensor(readings, dtype=torch.float64)
    recall, image = shown(x), shown.mirror()(x[:, [1, 0, 2]])
    # Codes of -1 and +1 and their sums are whole numbers, of which float sums are exact too.
    assert torch.equal(image.commands.nan_to_num(9), recall.commands[:, [1, 0]].nan_to_num(9))
    for field in ("similarity", "margin", "familiarity"):
        assert torch.equal(getattr(image, field), getattr(recall, field))


@pytest.mark.parametrize(("vsa", "rule"), [("MAP-C", Gradient()), ("MAP-C", LeastSquares()), ("FHRR", OneShot())])
def test_sums_that_round_are_mirrored_up_to_rounding(vsa: str, rule: Rule) -> None:
    shown = rule.fit(space(vsa), SHOWN)
    recall, image = shown(READINGS), shown.mirror()(MIRRORED.sensors)
    clear = recall.margin > 1e-5
    assert clear.sum() >= 38
    assert torch.equal(image.commands[clear], recall.commands[clear][:, [1, 0]])
    assert_close(image.similarity, recall.similarity, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("vsa", ELEMENTWISE)
def test_its_mirror_image_is_the_behaviour(vsa: str) -> None:
    made = space(vsa)
    one, two = OneShot().fit(made, SHOWN), OneShot().fit(made, MIRRORED)
    assert same(one.mirror().mirror(), one)
    both = one + 2 * two
    assert same(both.mirror().mirror(), both)
    assert not torch.equal(one.mirror().program, one.program)


@pytest.mark.parametrize("vsa", ["MAP-C", "MAP-B", "MAP-I", "BSC"])
def test_learning_mirrored_data_gives_the_mirrored_program(vsa: str) -> None:
    made = space(vsa)
    one, two = OneShot().fit(made, SHOWN).mirror(), OneShot().fit(made, MIRRORED)
    for name in ("program", "known", "results"):
        assert torch.equal(getattr(one, name), getattr(two, name))


def turns(readings: torch.Tensor) -> torch.Tensor:
    """Turn to the side that reads less, or drive straight on where the front is free."""
    left, right, front = readings.unbind(1)
    turn = torch.where((left < right)[:, None], torch.tensor([-1.0, 1.0]), torch.tensor([1.0, -1.0]))
    return torch.where((front > 12)[:, None], torch.ones(2), turn).double()


@pytest.mark.parametrize("seed", range(3))
def test_what_was_shown_on_one_side_is_known_on_both(seed: int) -> None:
    # Middles of bins, of which every condition of the left is shown.
    bins = torch.cartesian_prod(*[torch.arange(8)] * 3)
    grid = (bins.double() + 0.5) * 20 / 8
    left = grid[bins[:, 0] < bins[:, 1]]
    vsa = torchvsa.MAP(4000, dtype=torch.int8)
    made = Space(SCHEMA, Mirrored(Level(vsa, 8), [(0, 1)], 3), seed=seed, mirror=SWAP)
    shown = ErrorDriven().fit(made, Demonstrations(left, turns(left)))
    right = left[:, [1, 0, 2]]

    def agreement(controller: Behaviour, readings: torch.Tensor) -> float:
        return float((controller(readings).commands == turns(readings)).all(1).double().mean())

    assert agreement(shown, right) < 0.9
    assert agreement(shown.mirror(), right) == 1
    both = shown + shown.mirror()
    assert agreement(both, right) >= 0.99
    assert agreement(both, left) >= 0.99


def test_terms_are_mirrored_so_that_they_cancel(tmp_path: Path) -> None:
    bank = BehaviourBank(space())
    bank.learn("one", SHOWN, ErrorDriven())
    bank.learn("two", Demonstrations(READINGS + 0, -COMMANDS), ErrorDriven())
    one, two = bank["one"], bank["two"]
    both = one + two
    assert same(both.mirror() - two.mirror(), one.mirror())
    assert same(both + both.mirror() - one.mirror() - one, two + two.mirror())
    assert one.mirror().report.terms == ("mirror of one",)
    assert (2 * two - one.mirror()).report.terms == ("2 * two", "-mirror of one")
    bank.add("image", one.mirror())
    bank.add("sum", one + two.mirror())
    again = BehaviourBank.load(bank.save(tmp_path / "bank"))
    assert same(again["image"].mirror(), one)
    assert same(again["sum"] - again["two"].mirror(), 1 * one)
    assert again.save(tmp_path / "again").read_bytes() == (tmp_path / "bank").read_bytes()
    assert same(again["image"], bank["image"])


def test_a_mirrored_space_is_saved_and_made_again() -> None:
    made = space("BSC", 128, seed=4)
    config = made.config()
    assert config["mirror"] == SWAP
    assert Space.from_config(config).same_as(made)
    assert Space.from_config(config, made.state_dict()).same_as(made)
    assert "mirror" not in Space(SCHEMA).config()
    plain = {key: value for key, value in config.items() if key != "mirror"}
    assert not Space.from_config(plain).same_as(made)


def test_codes_of_commands_are_mirrored() -> None:
    vsa = torchvsa.MAP(64)
    codes = Lookup(vsa, 3, seed=0)
    before = codes.codes.clone()
    schema = Schema(SCHEMA.sensors, [*SCHEMA.actuators, Actuator("speed", 0, 1, levels=3)])
    results = Space(schema, vsa=vsa, command_codes=codes, mirror=SWAP).result_encoder
    assert torch.equal(results.roles[0].roll(32, -1), results.roles[1])
    assert not torch.equal(results.roles[0], results.roles[1])
    assert torch.equal(results.roles[2].roll(32, -1), results.roles[2])
    assert torch.equal(results.codes.roll(32, -1), results.codes)
    assert torch.equal(codes.codes, before)


def test_a_file_whose_codes_are_not_mirrored_is_refused(tmp_path: Path) -> None:
    bank = BehaviourBank(space(dim=64))
    bank.learn("one", SHOWN, OneShot())
    tensors, about = load_tensors(bank.save(tmp_path / "bank"), "bank")
    roles = tensors["space.result_encoder.roles"].clone()
    roles[1] = -roles[1]
    forged = tensors | {"space.result_encoder.roles": roles}
    with pytest.raises(ValueError, match="codes of commands are not mirrored"):
        BehaviourBank.load(save_tensors(tmp_path / "forged", "bank", forged, about))
    for wrong in ({"left": "up"}, [], "left", {"left": "right", "right": "front"}):
        changed = copy.deepcopy(about)
        changed["space"]["mirror"] = wrong
        with pytest.raises(ValueError, match="mirror"):
            BehaviourBank.load(save_tensors(tmp_path / "forged", "bank", tensors, changed))


def test_a_space_without_a_mirror_says_what_to_do() -> None:
    shown = OneShot().fit(Space(SCHEMA, vsa=torchvsa.MAP(64)), SHOWN)
    with pytest.raises(ValueError, match=r"make it with Space\(\.\.\., mirror="):
        shown.mirror()


VSA = torchvsa.MAP(64, dtype=torch.int8)
OTHER = Schema(
    [Sensor("left", 0, 20), Sensor("right", 0, 10), Sensor("speed", 0, 1)],
    [Actuator(name, -1, 1, levels=3) for name in ("a", "b", "c", "speed")],
)
VOTES = torchvsa.MAP(64, "B")
WRONG: dict[str, dict[str, Any]] = {
    "names 'up', which is no sensor or actuator": {"mirror": {"left": "up"}},
    "'left' more than once": {"mirror": {"left": "right", "front": "left"}},
    "'left' with 'left_motor', but one is a sensor": {"mirror": {"left": "left_motor"}},
    "names no sensors that swap; the sensors are left": {"mirror": {"left_motor": "right_motor"}},
    "mirror maps names to names": {"mirror": ["left", "right"]},
    "'left' with 'right', which differ": {"mirror": {"left": "right"}, "schema": OTHER},
    "'speed', which is a sensor and an actuator": {"mirror": {"left": "speed"}, "schema": OTHER},
    r"such as Mirrored\(Level\(vsa, 32\), pairs=\[\(0, 1\)\], sensors=3\); got Product": {
        "encoder": Product(Level(VSA, 8), 3)
    },
    r"got Mirrored with pairs=\[\(0, 2\)\]": {"encoder": Mirrored(Level(VSA, 8), [(0, 2)], 3)},
    "SelfShift does not commute": {"vsa": VSA, "protection": torchvsa.SelfShift(VSA)},
    "d is even": {"vsa": torchvsa.MAP(63)},
    "element-wise binding": {"vsa": torchvsa.HRR(64)},
    "first list two actuators": {
        "vsa": VOTES,
        "mirror": {"left": "right", "b": "c"},
        "schema": Schema(SCHEMA.sensors, OTHER.actuators),
    },
}


@pytest.mark.parametrize("message", WRONG)
def test_what_cannot_be_mirrored_is_refused(message: str) -> None:
    options = {"schema": SCHEMA, "mirror": SWAP} | WRONG[message]
    with pytest.raises(ValueError, match=message):
        Space(**options)


def test_the_side_of_a_pair_does_not_matter() -> None:
    encoder = Mirrored(Level(VSA, 8), [(1, 0)], 3)
    shown = OneShot().fit(Space(SCHEMA, encoder, mirror=SWAP), SHOWN)
    assert torch.equal(shown.mirror()(MIRRORED.sensors).commands, shown(READINGS).commands[:, [1, 0]])


class Computed(ValueEncoder):
    """Codes of levels that no codebook holds."""

    name = "computed"
    bins = 3

    def __init__(self) -> None:
        super().__init__()
        self.vsa = VSA
        self._own(None)

    def own_layout(self) -> dict[str, Any]:
        return {}

    def _draw(self, generator: torch.Generator | None) -> dict[str, torch.Tensor]:
        return {}

    def config(self) -> dict[str, Any]:
        return {"name": self.name}

    def cells(self, x: torch.Tensor) -> torch.Tensor:
        return (x * 2).long()

    def encode(self, cells: torch.Tensor) -> torch.Tensor:
        return VSA.identity().expand(*cells.shape, -1)


def test_command_codes_have_bins() -> None:
    with pytest.raises(ValueError, match="such as Balanced; got Computed"):
        Space(SCHEMA, vsa=VSA, command_codes=Computed(), mirror=SWAP)
    vsa = torchvsa.FHRR(64)
    with pytest.raises(ValueError, match="bins"):
        Space(SCHEMA, vsa=vsa, command_codes=FractionalPower(vsa), mirror=SWAP)
