"""Gradient descent: its loss, its options, and what they do to the program."""

from typing import Any, cast

import pytest
import torch
from robots import correct, random_pairs, same_bits, space

from behaviours import Demonstrations, Gradient, Space
from behaviours.learning import descent as module
from behaviours.learning.samples import Samples

SPREAD = {"name": "self_shift", "width": "sum"}
"""Pairs that hardly disturb each other, so that what is left to learn is the rule's."""


@pytest.mark.parametrize(("loss", "sparse"), [("cross_entropy", False), ("hinge", True), ("squared", False)])
def test_every_loss_learns_what_one_superposition_cannot(loss: Any, sparse: bool) -> None:
    shown = random_pairs(300)
    behaviour = Gradient(loss, epochs=60, batch_size=32, learning_rate=0.1, sparse=sparse).fit(
        space(2000, protection=SPREAD), shown
    )
    assert correct(behaviour, shown).mean() > 0.98


@pytest.mark.parametrize("sparse", [False, True])
def test_one_step_follows_the_gradient_of_the_loss(sparse: bool) -> None:
    shown, made = random_pairs(20), space(200)
    samples = Samples.of(made, shown)
    assert isinstance(samples.conditions, torch.Tensor)
    items = made.items(samples.results)
    descent = module.Descent(Gradient(sparse=sparse), made.vsa, samples, items)
    rows = torch.arange(20)
    descent.loss(rows).backward()
    # Where all scores are 0 every result, and silence, has the same share.
    shares = torch.full((20, len(items)), 1 / (len(items) + 1)) - torch.nn.functional.one_hot(
        samples.result, len(items)
    )
    lengths = items.double().norm(dim=1).float()
    slope = ((samples.conditions.float().T @ shares) * (items.float() / lengths[:, None]).T).sum(1) / 20
    root = module._ROOT
    expected = torch.stack([2 * root * slope, -2 * root * slope]) if sparse else slope
    assert descent.parameters.grad is not None
    torch.testing.assert_close(descent.parameters.grad, expected, atol=1e-6, rtol=1e-4)


@pytest.mark.parametrize("vsa", ["MAP-C", "HRR", "FHRR"])
@pytest.mark.parametrize("output", ["bipolar", "int8"])
def test_rounded_programs_still_recall(output: Any, vsa: str) -> None:
    shown = random_pairs(60)
    behaviour = Gradient(output=output, epochs=80).fit(space(4000, vsa, protection=SPREAD), shown)
    program = behaviour.program
    values = (torch.view_as_real(program) if program.is_complex() else program).unique()
    if output == "bipolar":
        assert values.tolist() == [-1, 1]
    else:
        assert values.abs().max() <= 127
        assert (values == values.round()).all()
        assert len(values) > 20
    assert correct(behaviour, shown).mean() > 0.9


def one_sensor_decides() -> tuple[Space, Demonstrations]:
    """500 readings of three sensors; the commands follow the first alone."""
    sensors = torch.rand(500, 3, generator=torch.Generator().manual_seed(0)) * 20
    commands = torch.where(sensors[:, :1] > 7, 1.0, -1.0).expand(-1, 2)
    return space(1000, protection="none", values="lookup", combine="threshold_features"), Demonstrations(
        sensors, commands
    )


def test_a_program_of_fractions_is_clipped_to_the_nearest_codes() -> None:
    shown = random_pairs(60)
    behaviour = Gradient(epochs=30).fit(space(2000, protection=SPREAD), shown)
    assert behaviour.program.abs().median() < 1
    clipped = behaviour.clipped()
    assert clipped.program.dtype == torch.int8
    assert correct(clipped, shown).mean() > 0.98


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
def test_sparse_programs_are_sparser() -> None:
    made, shown = one_sensor_decides()

    def share(rule: Gradient) -> float:
        program = rule.fit(made, shown).program.abs()
        return float(program.sum() ** 2 / (program**2).sum() / len(program))

    assert share(Gradient(sparse=True)) < 0.7 * share(Gradient())


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
def test_held_back_conditions_stop_the_training() -> None:
    made, shown = one_sensor_decides()
    rule = Gradient(validation_fraction=0.2, patience=3, epochs=80)
    behaviour = rule.fit(made, shown)
    assert 3 < behaviour.report.epochs < 80
    assert behaviour.report.wrong < 0.05 * len(shown)
    one = Demonstrations([[1.0, 1, 1]], [[0.0, 0]])
    with pytest.raises(ValueError, match=r"validation_fraction=0.2 of 1 conditions leaves none to validate with"):
        rule.fit(space(64), one)
    with pytest.raises(ValueError, match=r"validation_fraction=0.9 of 1 conditions leaves none to train on"):
        Gradient(validation_fraction=0.9).fit(space(64), one)


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
def test_the_seed_decides() -> None:
    shown, made = random_pairs(50), space(300)
    first, again, other = (Gradient(batch_size=16, epochs=5, seed=s).fit(made, shown).program for s in (0, 0, 1))
    assert same_bits(first, again)
    assert not torch.equal(first, other)


def test_the_majority_wins_a_contradiction() -> None:
    shown = Demonstrations([[1.0, 1, 1]] * 3, [[0.0, 1], [1, 1], [1, 1]])
    behaviour = Gradient().fit(space(500), shown)
    assert behaviour([[1.0, 1, 1]]).commands.tolist() == [[1, 1]]
    assert (behaviour.report.new, behaviour.report.truly_known, behaviour.report.contradicting) == (1, 2, 2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"loss": "loud"}, "loss is one of cross_entropy, hinge, squared; got 'loud'"),
        ({"output": "bits"}, "output is one of float, bipolar, int8; got 'bits'"),
    ],
)
def test_settings_that_make_no_sense(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Gradient(**cast(Any, options))
