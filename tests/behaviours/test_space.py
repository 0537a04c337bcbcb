"""Codebooks: drawn from the seed alone, made of named parts."""

from typing import Any, cast

import pytest
import torch
from robots import KINDS, SCHEMA, same_bits, space

from behaviours import Space
from torchvsa import MAP, SelfShift
from torchvsa.encoders import Level, Lookup, Product, Sum


def bits(made: Space) -> dict[str, torch.Tensor]:
    return {k: torch.view_as_real(v) if v.is_complex() else v for k, v in made.state_dict().items()}


@pytest.mark.parametrize("vsa", KINDS)
def test_the_seed_decides_every_codebook(vsa: str) -> None:
    torch.manual_seed(1)
    one = bits(space(128, vsa, seed=5))
    torch.manual_seed(2)
    same, other = bits(space(128, vsa, seed=5)), bits(space(128, vsa, seed=6))
    assert list(one) == list(same) == list(other)
    for key, values in one.items():
        assert same_bits(values, same[key]), key
        assert not same_bits(values, other[key]), key


def test_no_two_codebooks_are_alike() -> None:
    made = space(4000)
    assert isinstance(made.protect, SelfShift)
    encoder, results = made.encoder, made.result_encoder
    atoms = torch.cat([encoder.roles, encoder.codes, results.roles, results.codes, made.protect.h[None]]).double()
    cosines = (atoms @ atoms.T / 4000).fill_diagonal_(0)
    assert cosines.abs().max() < 5 / 4000**0.5


def test_a_condition_is_encoded_then_protected() -> None:
    made = space(256)
    bins = torch.tensor([[1, 2, 3], [-1, 2, 3]])
    for row in bins:
        parts = [made.encoder.roles[i] * made.encoder.codes[b] for i, b in enumerate(row.tolist()) if b >= 0]
        record = torch.stack(parts).sum(0).clamp(-1, 1).to(torch.int8)
        assert same_bits(made.encode(row[None])[0], made.protect(record))


def test_what_has_codebooks_is_kept_and_plans_are_copied() -> None:
    vsa = MAP(64, dtype=torch.int8)
    given, plan = SelfShift(vsa, width="sum", seed=3), Product(Level(vsa, 8), 3)
    one, two = (Space(SCHEMA, plan, protection=given, seed=seed) for seed in (0, 1))
    assert one.protect is two.protect is given
    assert not plan.drawn
    assert not torch.equal(cast(Product, one.encoder).roles, cast(Product, two.encoder).roles)
    drawn = Product(Level(vsa, 8), 3, seed=0)
    assert Space(SCHEMA, drawn).encoder is drawn


def test_an_encoder_a_vsa_or_neither() -> None:
    assert Space(SCHEMA).vsa == MAP(4000, dtype=torch.int8)
    assert Space(SCHEMA, vsa=MAP(64)).encoder.vsa == MAP(64)
    encoder = Sum(Lookup(MAP(64), 8), 3)
    assert Space(SCHEMA, encoder, MAP(64)).vsa == MAP(64)


def test_an_equal_space_is_made_from_its_config() -> None:
    made = space(64, "BSC", protection={"name": "self_shift", "width": "sum"}, seed=7, values="level", span=4)
    again = Space.from_config(made.config())
    assert again.config() == made.config()
    assert all(same_bits(value, bits(again)[key]) for key, value in bits(made).items())


VSA = MAP(64)
WRONG: dict[str, dict[str, Any]] = {
    "encoder is an object such as": {"encoder": VSA},
    "vsa is an object such as": {"vsa": "MAP-C"},
    "protection is an object such as": {"protection": SelfShift},
    "the encoder works on MAP-C": {"encoder": Sum(Lookup(VSA, 8), 3), "vsa": MAP(32)},
    "the encoder is for 2 sensors; the schema has 3": {"encoder": Sum(Lookup(VSA, 8), 2)},
    "SelfShift works on MAP-C": {"vsa": MAP(32), "protection": SelfShift(VSA)},
    "the codes of commands are for 4 levels; the schema has 3": {"vsa": VSA, "command_codes": Lookup(VSA, 4)},
    "seed is a whole number from 0 to 9223372036854775807; got 0.5": {"seed": 0.5},
    "seed is a whole number from 0 to 9223372036854775807; got -1": {"seed": -1},
}


@pytest.mark.parametrize("message", WRONG)
def test_parts_that_do_not_fit(message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Space(SCHEMA, **WRONG[message])


def test_configurations_of_parts_that_do_not_exist() -> None:
    config = space(64).config()
    with pytest.raises(ValueError, match="no protection 'helmet'; choose one of self_shift, fixed_shift, none"):
        Space.from_config(config | {"protection": {"name": "helmet"}})
    with pytest.raises(ValueError, match="no encoder 'knot'; choose one of sum, product"):
        Space.from_config(config | {"encoder": config["encoder"] | {"name": "knot"}})
    with pytest.raises(ValueError, match="no value encoder 'rainbow'"):
        Space.from_config(config | {"command_codes": {"name": "rainbow"}})
