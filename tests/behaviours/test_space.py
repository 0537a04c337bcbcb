"""Codebooks: drawn from the seed alone, made of named parts."""

import pytest
import torch
from robots import SCHEMA, same_bits, space

from behaviours import Encoder, Space
from torchvsa import ARCHITECTURES, MAP, FixedShift, SelfShift


def bits(made: Space) -> dict[str, torch.Tensor]:
    return {k: torch.view_as_real(v) if v.is_complex() else v for k, v in made.state_dict().items()}


@pytest.mark.parametrize("vsa", ARCHITECTURES)
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
    atoms = torch.cat(
        [made.encoder.roles, made.encoder.codes, made.results.roles, made.results.codes, made.protect.h[None]]
    ).double()
    cosines = (atoms @ atoms.T / 4000).fill_diagonal_(0)
    assert cosines.abs().max() < 5 / 4000**0.5


def test_a_condition_is_encoded_then_protected() -> None:
    made = space(256)
    bins = torch.tensor([[1, 2, 3], [-1, 2, 3]])
    for row in bins:
        parts = [made.encoder.roles[i] * made.encoder.codes[b] for i, b in enumerate(row.tolist()) if b >= 0]
        record = torch.stack(parts).sum(0).clamp(-1, 1).to(torch.int8)
        assert same_bits(made.encode(row[None])[0], made.protect(record))


def test_a_protection_may_be_given_by_name_with_options_or_whole() -> None:
    assert isinstance(space(64, protection="none").protect, torch.nn.Module)
    shifted = space(64, protection={"name": "fixed_shift", "shift": 5}).protect
    assert isinstance(shifted, FixedShift)
    assert shifted.shift == 5
    vsa = MAP(64, dtype=torch.int8)
    given = SelfShift(vsa, width="sum", seed=3)
    assert space(vsa=vsa, protection=given).protect is given
    with pytest.raises(ValueError, match="the protection works on MAP-C"):
        space(128, protection=given)


def test_an_equal_space_is_made_from_its_config() -> None:
    made = space(64, "BSC", protection={"name": "self_shift", "width": "sum"}, seed=7, values="level", span=4)
    again = Space.from_config(made.config())
    assert again.config() == made.config()
    assert all(same_bits(value, bits(again)[key]) for key, value in bits(made).items())


def test_parts_that_do_not_exist() -> None:
    vsa = MAP(64)
    with pytest.raises(ValueError, match="no protection 'helmet'; choose one of self_shift, fixed_shift, none"):
        Space(SCHEMA, vsa, protection="helmet")
    with pytest.raises(ValueError, match="no value encoder 'rainbow'"):
        Space(SCHEMA, vsa, Encoder(values="rainbow"))
    with pytest.raises(ValueError, match="no combination 'knot'"):
        Space(SCHEMA, vsa, Encoder(combine="knot"))
    with pytest.raises(ValueError, match="bins is a whole number of at least 1; got 0"):
        Space(SCHEMA, vsa, Encoder(bins=0))
