"""Which behaviour a robot is running."""

import math

import pytest
import torch
from if_else import SCHEMA, Rules, learned, readings, space, variants
from robots import KINDS, random_pairs
from robots import space as other_space

from behaviours import BehaviourBank, Demonstrations, OneShot, Recognition, Space, recognise
from torchvsa import MAP
from torchvsa.encoders import History, Level, Product

NAMES = ("seek", "flee", "near", "blind")
BANK = learned(
    {"seek": Rules(), "flee": Rules(turn=-1), "near": Rules(light_below=1.2), "blind": Rules(light_below=0.1)}
)


def steps(name: str, count: int, seed: int) -> tuple[torch.Tensor, torch.Tensor]:
    x = readings(300)[torch.randperm(300, generator=torch.Generator().manual_seed(seed))[:count]]
    return x, BANK[name](x).commands


def test_each_behaviour_is_recognised_by_what_it_does() -> None:
    for index, name in enumerate(NAMES):
        found = recognise(BANK, *steps(name, 60, seed=index))
        assert found.names == NAMES
        assert found.best == [name]
        assert found.index.tolist() == [index]
        assert found.scores.shape == (1, 4)
        assert found.scores[0, index] == 0
        assert (found.scores[0] <= 0).all()


def test_more_steps_tell_more() -> None:
    correct = []
    for count in (1, 5, 40):
        runs = torch.arange(40).repeat_interleave(count)
        shown = [steps(NAMES[run % 4], count, seed=run) for run in range(40)]
        x, commands = (torch.cat(column) for column in zip(*shown, strict=True))
        found = recognise(BANK, x, commands, runs)
        correct.append(float((found.index == torch.arange(40) % 4).double().mean()))
    assert correct == sorted(correct)
    assert correct[0] < 0.8
    assert correct[-1] == 1


def test_the_score_is_the_mean_lead_of_what_was_seen() -> None:
    x, commands = steps("seek", 20, seed=5)
    found = recognise(BANK, x, commands)
    for column, name in enumerate(NAMES):
        behaviour = BANK[name]
        # All of these behaviours have the same three results, in an order of their own.
        scores, label = behaviour.scores(x), behaviour.labels(commands)
        own = scores.gather(1, label[:, None])[:, 0]
        others = scores.scatter(1, label[:, None], -torch.inf).amax(1)
        wanted = (own - others).clamp(max=0).mean() / behaviour.program.double().norm()
        assert float(found.scores[0, column]) == pytest.approx(float(wanted), rel=1e-9, abs=1e-12)


def test_runs_may_be_mixed_and_have_any_numbers() -> None:
    (x, seek), (y, flee) = steps("seek", 30, 1), steps("flee", 30, 2)
    order = torch.randperm(60, generator=torch.Generator().manual_seed(0))
    both = torch.cat([x, y])[order], torch.cat([seek, flee])[order]
    found = recognise(BANK, *both, torch.tensor([7] * 30 + [-2] * 30)[order])
    assert found.best == ["flee", "seek"]
    assert torch.allclose(found.scores[1], recognise(BANK, x, seek).scores[0], atol=1e-15)
    assert len(found) == 2
    assert str(found) == "run 0: flee (0); run 1: seek (0)"


def test_the_lengths_of_programs_do_not_matter() -> None:
    bank = BehaviourBank(BANK.space)
    for number, name in enumerate(NAMES):
        bank.add(name, (1 + 3 * number) * BANK[name])
    x, commands = steps("near", 50, seed=3)
    assert torch.allclose(recognise(bank, x, commands).scores, recognise(BANK, x, commands).scores)


@pytest.mark.parametrize("vsa", KINDS)
def test_behaviours_with_different_results_compete(vsa: str) -> None:
    bank = BehaviourBank(other_space(500, vsa))
    for number in range(3):
        shown = random_pairs(8, seed=number)
        commands = torch.stack([torch.full((8,), number - 1.0), torch.arange(8) % 3 - 1.0], 1)
        bank.learn(str(number), Demonstrations(shown.sensors, commands), OneShot())
    for number in range(3):
        x = random_pairs(8, seed=number).sensors
        assert recognise(bank, x, bank[str(number)](x).commands).best == [str(number)]


def test_a_step_in_which_nothing_was_observed_tells_nothing() -> None:
    x, commands = steps("flee", 10, seed=4)
    unseen = torch.full((10, 3), math.nan, dtype=torch.float64)
    half = recognise(BANK, torch.cat([x, unseen]), torch.cat([commands, commands]))
    assert torch.allclose(2 * half.scores, recognise(BANK, x, commands).scores)
    assert (recognise(BANK, unseen, commands).scores == 0).all()


def test_past_readings_are_of_the_same_run() -> None:
    vsa = MAP(500, dtype=torch.int8)
    made = Space(SCHEMA, History(Product(Level(vsa, 8), 3), [1]))
    bank = BehaviourBank(made)
    x, runs = readings(30), torch.arange(3).repeat_interleave(10)
    for name, rule in zip("ab", variants(2), strict=True):
        bank.learn(name, Demonstrations(x, rule(x.roll(1, 0)), runs), OneShot())
    commands = variants(2)[1](x.roll(1, 0))
    assert recognise(bank, x, commands, runs).best == ["b"] * 3


def test_what_cannot_be_recognised_is_refused() -> None:
    x, commands = steps("seek", 4, seed=0)
    with pytest.raises(ValueError, match=r"row 2 of the commands has the levels \[0, 0\], which no behaviour"):
        recognise(BANK, x, torch.cat([commands[:2], torch.tensor([[-1.0, -1.0]]), commands[3:]]))
    with pytest.raises(ValueError, match="this bank is empty"):
        recognise(BehaviourBank(space(dim=64)), x, commands)
    with pytest.raises(ValueError, match="at least one row"):
        recognise(BANK, x[:0], commands[:0])
    with pytest.raises(ValueError, match="commands has 3 rows, but sensors has 4"):
        recognise(BANK, x, commands[:3])
    for runs in (torch.zeros(3), torch.zeros(4, 1)):
        with pytest.raises(ValueError, match=r"runs is one number per step, \[4\]"):
            recognise(BANK, x, commands, runs)
    with pytest.raises(ValueError, match="runs must be whole numbers"):
        recognise(BANK, x, commands, torch.tensor([0.5, 1, 2, 3]))
    with pytest.raises(ValueError, match="'light_left' reads 9 in row 0"):
        recognise(BANK, x + torch.tensor([9.0, 0, 0]) - x * torch.tensor([1.0, 0, 0]), commands)


def test_many_runs_are_shortened_in_print() -> None:
    found = Recognition(("a",), torch.zeros(12, 1, dtype=torch.float64), torch.zeros(12, dtype=torch.int64))
    assert str(found).endswith("run 9: a (0); and 2 more")
