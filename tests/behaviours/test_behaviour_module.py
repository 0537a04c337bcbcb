"""A behaviour is a plain nn.Module: what is loaded, copied or clipped is what answers."""

from copy import deepcopy

import pytest
import torch
from robots import KINDS, correct, random_pairs, same_bits, space

from behaviours import Behaviour, ErrorDriven, OneShot, Recall


def same(a: Recall, b: Recall) -> bool:
    return all(same_bits(x, y) for x, y in zip(a[:4], b[:4], strict=True) if x is not None and y is not None)


@pytest.mark.parametrize("vsa", KINDS)
def test_a_loaded_state_answers_at_once(vsa: str) -> None:
    """Asked before loading as well, so that nothing kept from then may answer."""
    shown, others = random_pairs(12), random_pairs(12, seed=8)
    taught = OneShot().fit(space(512, vsa, seed=1), shown)
    blank = OneShot().fit(space(512, vsa, seed=2), others)
    blank.results.resize_(taught.results.shape)
    before = blank(shown.sensors)
    blank.load_state_dict(taught.state_dict())
    after = blank(shown.sensors)
    assert not same(before, after)
    assert same(after, taught(shown.sensors))


def test_the_state_is_all_there_is() -> None:
    behaviour = OneShot().fit(space(128), random_pairs(12))
    assert {"program", "known", "memory.levels"} <= set(behaviour.state_dict())
    assert any(key.startswith("space.encoder.") for key in behaviour.state_dict())


def test_a_changed_program_answers_at_once() -> None:
    shown = random_pairs(12)
    behaviour = OneShot().fit(space(1024), shown)
    first = behaviour(shown.sensors)
    behaviour.program.neg_()
    assert not same(behaviour(shown.sensors), first)
    behaviour.program.neg_()
    assert same(behaviour(shown.sensors), first)


def test_a_copy_is_its_own() -> None:
    shown = random_pairs(12)
    behaviour = OneShot().fit(space(1024), shown)
    copy = deepcopy(behaviour)
    expected = behaviour(shown.sensors)
    assert same(copy(shown.sensors), expected)
    copy.program.zero_()
    copy.space.encoder.table.zero_()
    assert same(behaviour(shown.sensors), expected)


def test_an_empty_program_is_not_sure_of_anything() -> None:
    shown = random_pairs(12)
    behaviour = OneShot().fit(space(256), shown)
    behaviour.program.zero_()
    behaviour.known.zero_()
    recall = behaviour(shown.sensors)
    for part in (recall.similarity, recall.margin, recall.familiarity):
        assert part.tolist() == [0.0] * 12


def test_clipped_is_a_clipped_copy() -> None:
    shown = random_pairs(40)
    behaviour = ErrorDriven().fit(space(512), shown)
    raw = behaviour.program.clone()
    clipped = behaviour.clipped()
    assert isinstance(clipped, Behaviour)
    assert same_bits(clipped.program, raw.clamp(-1, 1).to(torch.int8))
    assert same_bits(clipped.known, behaviour.known.clamp(-1, 1).to(torch.int8))
    assert same_bits(behaviour.program, raw)
    assert clipped.results.tolist() == behaviour.results.tolist()


@pytest.mark.parametrize("vsa", KINDS)
def test_a_clipped_program_still_answers(vsa: str) -> None:
    # Three pairs keep much of their similarity even as bits.
    shown = random_pairs(3)
    behaviour = OneShot().fit(space(2000, vsa, protection={"name": "self_shift", "width": "sum"}), shown)
    assert correct(behaviour.clipped(), shown).mean() == 1
