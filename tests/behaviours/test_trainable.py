"""A behaviour in an ordinary training loop."""

import textwrap
from copy import deepcopy
from pathlib import Path

import pytest
import torch
from plain import wide
from robots import KINDS, correct, random_pairs, same_bits, space

from behaviours import Behaviour, BehaviourBank, Bundle, OneShot
from behaviours.behaviour import Behaviour as Documented


def ten_lines() -> str:
    """The loop of the docstring."""
    lines = (Documented.trainable.__doc__ or "").splitlines()
    return textwrap.dedent("\n".join(line for line in lines if line.startswith(" " * 12)))


def test_ten_lines_teach_what_one_superposition_does_not_hold(tmp_path: Path) -> None:
    shown = random_pairs(300)
    bank = BehaviourBank(space(2000, protection={"name": "self_shift", "width": "sum"}))
    bank.learn("seek_light", shown, OneShot())
    bank.learn("avoid", random_pairs(5, seed=1), OneShot())
    before = bank["seek_light"]
    assert correct(before, shown).mean() < 0.9
    names = {"bank": bank, "shown": shown, "torch": torch}
    assert len(ten_lines().strip().splitlines()) <= 10
    exec(ten_lines(), names)
    taught = bank["seek_light"]
    assert isinstance(taught.program, torch.nn.Parameter)
    assert correct(taught, shown).mean() == 1
    assert before.program.dtype == torch.int32

    copy = deepcopy(taught)
    assert isinstance(copy.program, torch.nn.Parameter)
    with torch.no_grad():
        taught.program.add_(0)
    loaded = BehaviourBank.load(bank.save(tmp_path / "bank"))["seek_light"]
    exported = torch.export.export(taught, (shown.sensors,), dynamic_shapes=({0: torch.export.Dim("batch")},)).module()
    answers = taught(shown.sensors)
    for again in (copy, loaded, exported):
        recall = again(shown.sensors)
        assert torch.equal(recall.commands, answers.commands)
        torch.testing.assert_close(recall.similarity, answers.similarity)
    assert correct(loaded, shown).mean() == 1
    # It can be added to others, and trained again.
    assert Bundle(bank)(shown.sensors).commands.shape == (300, 2)
    assert [p.shape for p in loaded.trainable().parameters()] == [(2000,)]


@pytest.mark.parametrize("vsa", KINDS)
def test_scores_are_those_of_recall_and_have_their_gradient(vsa: str) -> None:
    shown = random_pairs(8)
    behaviour = OneShot().fit(space(128, vsa), shown).trainable()
    made, items = behaviour.space, behaviour.memory.items
    scores = behaviour.scores(shown.sensors)
    assert scores.shape == (8, len(items))
    assert scores.argmax(1).tolist() == [
        behaviour.results.tolist().index(level)
        for level in made.schema.command_levels(behaviour(shown.sensors).commands).tolist()
    ]
    conditions = made.encode(made.cells(shown.sensors))
    for row, condition in enumerate(conditions):
        noisy = wide(made.vsa.unbind(behaviour.program.detach(), condition))
        for column, item in enumerate(items):
            code = wide(item)
            expected = (code.conj() @ noisy).real / float((abs(code) ** 2).sum()) ** 0.5
            assert scores[row, column].item() == pytest.approx(expected, abs=1e-3)
    # Scores are linear in the program: the slope along any direction is the score of that direction.
    generator = torch.Generator().manual_seed(0)
    direction = torch.randn(128, generator=generator).to(behaviour.program.dtype)
    weights = torch.randn(scores.shape, generator=generator, dtype=torch.float64)
    (gradient,) = torch.autograd.grad((scores * weights).sum(), [behaviour.program])
    slope = (gradient.conj() * direction).real.sum()
    along = Behaviour(made, direction, behaviour.known, behaviour.results, behaviour.report)
    assert slope.item() == pytest.approx((along.scores(shown.sensors) * weights).sum().item(), rel=1e-3, abs=1e-3)


def test_a_trainable_copy_answers_the_same_and_leaves_the_original_alone() -> None:
    shown = random_pairs(12)
    behaviour = OneShot().fit(space(512), shown)
    copy = behaviour.trainable()
    assert list(behaviour.parameters()) == []
    assert [name for name, _ in copy.named_parameters()] == ["program"]
    assert copy.space is behaviour.space
    assert list(copy.state_dict()) == list(behaviour.state_dict()) or set(copy.state_dict()) == set(
        behaviour.state_dict()
    )
    assert torch.equal(copy(shown.sensors).commands, behaviour(shown.sensors).commands)
    program = behaviour.program.clone()
    with torch.no_grad():
        copy.program.zero_()
        copy.known.zero_()
    assert same_bits(behaviour.program, program)
    assert behaviour.known.any()
    copy.load_state_dict(behaviour.state_dict())
    assert copy.program.tolist() == program.tolist()
    assert copy.clipped().program.requires_grad is False


def test_labels_are_the_rows_of_the_clean_up_memory() -> None:
    shown = random_pairs(40)
    behaviour = OneShot().fit(space(64), shown)
    labels = behaviour.labels(shown.commands)
    assert torch.equal(behaviour.space.schema.command_values(behaviour.results[labels]), shown.commands)
    few = OneShot().fit(space(64), shown.where(torch.arange(40) < 1))
    with pytest.raises(ValueError, match=r"row \d+ has the levels \[\d, \d\], which are none of the 1 stored results"):
        few.labels(shown.commands)
