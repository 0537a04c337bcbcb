"""Behaviours learn and answer on another device as they do on the CPU, and their tensors stay there.

The other device is a GPU where there is one, and everywhere a pretended one; each is in a process of its own.
"""

from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from devices import other
from on_devices import brought, close, same, seeded
from robots import KINDS, random_pairs, space
from torch import nn

import torchvsa
from behaviours import (
    POLICIES,
    RULES,
    Behaviour,
    BehaviourBank,
    Demonstrations,
    ErrorDriven,
    Gradient,
    OneShot,
    Policy,
    Rule,
    Space,
)
from behaviours.edges import quantile_edges
from torchvsa.encoders import History
from torchvsa.encoders.history import windows

SHOWN = random_pairs(20)


TWICE = Demonstrations(SHOWN.sensors.repeat(2, 1), torch.cat([SHOWN.commands, SHOWN.commands.flip(0)]))
"""Each condition with two results."""


PLAIN: list[Rule] = [
    *(rule() for rule in RULES.values() if rule not in (ErrorDriven, Gradient)),
    ErrorDriven(epochs=3),
    Gradient(epochs=3),
]
OPTIONS: list[Rule] = [
    OneShot("similarity"),
    OneShot("similarity", clip_each_step=True),
    OneShot(clip_each_step=True, contradictions="majority"),
    ErrorDriven(epochs=3, average=True, contradictions="latest"),
    Gradient(epochs=3, sparse=True, validation_fraction=0.2),
]


# Each rule in half of the architectures, whose own lines `test_algebra_on_devices` checks; each option, another line of
# the rule alone, in one.
LEARNED = [(rule, name) for turn, rule in enumerate(PLAIN) for name in KINDS[turn % 2 :: 2]] + [
    (rule, KINDS[turn]) for turn, rule in enumerate(OPTIONS)
]


@pytest.mark.parametrize(
    ("rule", "name"), [(r, name) for r, name in LEARNED if r.supports(torchvsa.architecture_near(name, 8))], ids=str
)
def test_learning_and_recall(there: Callable[..., None], rule: Rule, name: str) -> None:
    there(check_learning, rule, name)


def check_learning(rule: Rule, name: str) -> None:
    here, away = (rule.fit(s, TWICE) for s in spaces(name))
    tolerance = other().TRAINED if isinstance(rule, Gradient) else other().TOLERANCE
    alike(here, away, exact=here.space.vsa.integer and rule.integer_programs, tolerance=tolerance)
    alike(here, other().moved(here), exact=True)
    alike(here.clipped(), away.clipped(), exact=False, tolerance=tolerance)
    alike(here.trainable(), away.trainable(), exact=False, tolerance=tolerance)
    answers_alike(here.freeze(), away.freeze(), tolerance)
    more = random_pairs(20, seed=1)
    try:
        here = rule.partial_fit(here, more)
    except ValueError:
        return  # it cannot go on
    alike(here, rule.partial_fit(away, more), here.space.vsa.integer and rule.integer_programs, tolerance)


def test_conditions_too_many_to_be_held(there: Callable[..., None]) -> None:
    there(check_unheld)


def check_unheld() -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("behaviours.learning.conditions.HELD_BYTES", 0)
        alike(*(OneShot("similarity").fit(s, TWICE) for s in spaces("MAP-C")), exact=True)


def spaces(name: str) -> list[Space]:
    """The same codebooks on both devices."""
    return [space(100, name).to(device) for device in ("cpu", other().NAME)]


def alike(here: Behaviour, away: Behaviour, exact: bool, tolerance: float | None = None) -> None:
    """The same program on another device, with the same report and the same answers."""
    assert here.report == away.report
    for mine, theirs in ((here.program, away.program), (here.known, away.known)):
        close(other().brought_back(theirs), mine, exact, tolerance)
    answers_alike(here, away, tolerance)
    close(other().brought_back(away.scores(SHOWN.sensors)), here.scores(SHOWN.sensors), tolerance=tolerance)
    assert torch.equal(other().brought_back(away.labels(SHOWN.commands)), here.labels(SHOWN.commands))


def answers_alike(here: nn.Module, away: nn.Module, tolerance: float | None = None) -> None:
    """The same answers, each where its module is."""
    away(SHOWN.sensors)  # the first call may fold the program, and look at its values
    other().waited.clear()
    mine, theirs = here(SHOWN.sensors), away(SHOWN.sensors)
    assert other().waited == []
    theirs = other().brought_back(theirs)
    close(theirs[1:], brought(mine[1:]), tolerance=tolerance)
    # Where two results are as good as equal, either may win.
    clear = mine.margin > (other().TOLERANCE if tolerance is None else tolerance)
    close(theirs[0][clear], mine.commands[clear], tolerance=tolerance)


def test_demonstrations_that_lie_there(there: Callable[..., None]) -> None:
    there(check_demonstrations)


def check_demonstrations() -> None:
    shown = Demonstrations(other().moved(TWICE.sensors), other().moved(TWICE.commands))
    here, away = spaces("MAP-C")
    learned = OneShot().fit(here, TWICE)
    assert torch.equal(OneShot().fit(here, shown).program, learned.program)
    alike(learned, OneShot().fit(away, shown), exact=True)
    same(lambda behaviour, readings: behaviour(readings), learned, SHOWN.sensors, exact=False, waits=True)
    lost = torch.where(torch.rand(SHOWN.sensors.shape, generator=seeded(0)) < 0.3, torch.nan, SHOWN.sensors)
    episodes = torch.arange(20) // 7
    for hold in (False, True):
        same(lambda r, e, hold=hold: windows(r, e, [1, 3], hold), lost, episodes, waits=True)
    same(lambda readings: quantile_edges(readings, 5), SHOWN.sensors[:, 0], waits=True)
    assert len(shown.where([row < 5 for row in range(len(shown))])) == 5
    history = History(here.encoder, [1])
    same(lambda encode, rows: encode(rows), history, history.windows(here.schema.normalise(SHOWN.sensors), episodes))


@pytest.mark.parametrize("policy", POLICIES.values(), ids=POLICIES.keys())
def test_policies_and_banks(
    there: Callable[..., None], policy: Callable[[BehaviourBank], Policy], tmp_path: Path
) -> None:
    there(check_policies, policy, tmp_path / "bank.safetensors")


def check_policies(policy: Callable[[BehaviourBank], Policy], path: Path) -> None:
    banks = [BehaviourBank(s) for s in spaces("MAP-C")]
    for bank in banks:
        bank.learn("low", SHOWN.where([row < 10 for row in range(20)]), OneShot())
        bank.learn("high", SHOWN.where([row >= 10 for row in range(20)]), OneShot())
    here, away = (policy(bank) for bank in banks)
    answers_alike(here, away)
    answers_alike(here, other().moved(here))
    loaded = BehaviourBank.load(banks[1].save(path))
    assert torch.equal(loaded["low"].program, banks[0]["low"].program)
