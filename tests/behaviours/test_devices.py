"""Everything answers on another device as it does on the CPU, and its answers stay there.

A pretended device takes the place of a GPU, which few machines that run tests have; it lives in a process of its own.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from devices import another_device
from robots import random_pairs, space
from torch import Tensor, nn
from torch.testing import assert_close

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
from torchvsa import ARCHITECTURES, PROTECTIONS, CleanUp, SelfShift
from torchvsa._blocks import by_blocks
from torchvsa.encoders import Encoder, History, Product, SubsetProduct, Sum, ThresholdFeatures, value_encoder
from torchvsa.encoders.history import windows

SHOWN = random_pairs(40)
TWICE = Demonstrations(SHOWN.sensors.repeat(2, 1), torch.cat([SHOWN.commands, SHOWN.commands.flip(0)]))
"""Each condition with two results."""


TOLERANCE = 1e-5


@pytest.fixture(scope="module")
def there() -> Iterator[Callable[..., None]]:
    """`there(check, *arguments)` in a process with the pretended device."""
    with another_device() as run:
        yield run


def test_it_is_as_strict_as_a_gpu(there: Callable[..., None]) -> None:
    there(check_strictness)


def check_strictness() -> None:
    from pretended import NAME, brought_back, moved, waited

    here = torch.arange(4)
    away = moved(here)
    assert away.device.type == torch.ones(1, device=NAME).device.type == NAME
    mixed: list[Callable[[], Any]] = [lambda: away + here, lambda: here[away], lambda: torch.stack([here, away])]
    for mix in mixed:
        with pytest.raises(RuntimeError, match="on the CPU and on another device"):
            mix()
    with pytest.raises(TypeError, match="no NumPy array"):
        away.numpy()
    with pytest.raises(AssertionError, match="on the CPU"):
        brought_back(here)
    away[here[:2]] += 1
    assert brought_back(away).tolist() == [1, 2, 2, 3]
    waits: list[Callable[[], Any]] = [away.sum().item, away.cpu, away.tolist, away.unique, lambda: away[away > 1]]
    for wait in waits:
        waited.clear()
        wait()
        assert len(waited) == 1
    waited.clear()
    assert brought_back(away.to(torch.int8).clamp(0, 1)[away]).tolist() == [1, 1, 1, 1]
    assert waited == []


def same(work: Callable[..., Any], *arguments: Tensor | nn.Module, exact: bool = True, waits: bool = False) -> None:
    """`work` answers alike on both devices, where its arguments are, and does not wait for the device unless it may."""
    from pretended import brought_back, moved, waited

    copies = [moved(argument) for argument in arguments]
    waited.clear()
    away = work(*copies)
    assert waits or waited == []
    close(brought_back(away), brought(work(*arguments)), exact)


def close(answer: Any, expected: Any, exact: bool) -> None:
    """The same numbers in the same type, or nearly so."""
    tolerance = 0 if exact else TOLERANCE
    assert_close(answer, expected, atol=tolerance, rtol=tolerance, equal_nan=True)


def brought(answer: Any) -> Any:
    """A (named) tuple without what it leaves empty; a tensor as it is."""
    return tuple(brought(part) for part in answer if part is not None) if isinstance(answer, tuple) else answer


def seeded(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@pytest.mark.parametrize("rows", [3, 200])
@pytest.mark.parametrize("name", ARCHITECTURES)
def test_the_algebra(there: Callable[..., None], name: str, rows: int) -> None:
    there(check_algebra, name, rows)


def check_algebra(name: str, rows: int) -> None:
    vsa = torchvsa.architecture(name, 100)
    a, b = (vsa.random(rows, generator=seeded(seed)) for seed in (0, 1))
    numbers = torch.arange(rows) * 7
    for verb in (vsa.bind, vsa.unbind, vsa._bundle_pair, vsa.similarity, vsa.unbundle):
        same(verb, a, b, exact=vsa.integer)
    same(vsa.permute, a, numbers)
    same(lambda a: vsa.permute(a, -3), a)
    same(lambda a, b: vsa.bundle(torch.stack([a, b]), 0), a, b)
    same(lambda a, w: vsa.bundle(a, weights=w), a, numbers, exact=vsa.integer)
    same(lambda a, w: vsa.normalize(vsa.superpose(a, weights=w)), a, numbers, exact=vsa.integer)
    same(lambda a, b, w: vsa.permute(vsa._bundle_pair(a, b[0]), w), a, b, numbers, exact=vsa.integer)
    same(lambda a, b: vsa.unbound_norm(a[0], b), a, b, exact=vsa.integer)
    same(vsa.positive, a)
    same(lambda a, b: CleanUp(a)(b), a, b, exact=False)
    same(lambda a: vsa.random(4, generator=seeded(2), device=a.device), a)


def test_blocks_on_it_are_larger(there: Callable[..., None]) -> None:
    there(check_blocks)


def check_blocks() -> None:
    from pretended import brought_back, moved

    seen: list[int] = []

    def work(rows: Tensor) -> Tensor:
        seen.append(len(rows))
        return rows + 1

    answer = by_blocks(work, moved(torch.arange(10)), row_bytes=2**26, block_bytes=1)
    assert seen == [4, 4, 2]
    assert brought_back(answer).tolist() == list(range(1, 11))


def test_a_graph_rotates_in_one_pass(there: Callable[..., None]) -> None:
    there(check_graph)


def check_graph() -> None:
    from pretended import brought_back, moved

    vsa = torchvsa.MAP(100, dtype=torch.int8)
    vectors = vsa.bundle(vsa.random(200, 3, generator=seeded(0)))
    protect, asked = moved(SelfShift(vsa, seed=0)), moved(vectors)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch.compiler, "is_compiling", lambda: True)
        patch.delattr("torch.Tensor.as_strided")
        answer = brought_back(protect(asked))
    assert torch.equal(answer, SelfShift(vsa, seed=0)(vectors))


@pytest.mark.parametrize("rows", [3, 200])
@pytest.mark.parametrize("name", ARCHITECTURES)
def test_modules(there: Callable[..., None], name: str, rows: int) -> None:
    there(check_modules, name, rows)


def check_modules(name: str, rows: int) -> None:
    vsa = torchvsa.architecture(name, 100)
    vectors = vsa.random(rows, generator=seeded(0))
    for protection in PROTECTIONS:
        protect = torchvsa.protection({"name": protection}, vsa).draw(seeded(3))
        same(lambda protect, x: protect(x), protect, vectors, exact=vsa.integer)
        same(lambda protect, y: protect.invert(y), protect, protect(vectors), exact=vsa.integer)
    same(lambda memory, x: memory(x), CleanUp(vectors[:3]), vectors, exact=False)
    x = torch.rand(rows, 3, generator=seeded(1), dtype=torch.float64)
    x[::4, 1] = torch.nan
    encoders: list[Encoder] = [
        record(value_encoder({"name": values, "bins": 5}, vsa), 3)
        for values in ("lookup", "level", "balanced", "thermometer", "circular")
        for record in (Sum, Product, SubsetProduct)
        if vsa.elementwise or record is not SubsetProduct
    ]
    if vsa.elementwise:
        encoders.append(ThresholdFeatures(vsa, 3, 5))
    for encoder in encoders:
        same(lambda encode, rows: encode(rows), encoder.draw(seeded(2)), x, exact=vsa.integer)


RULES_AND_OPTIONS: list[Rule] = [
    *(rule() for rule in RULES.values() if rule not in (ErrorDriven, Gradient)),
    OneShot("similarity"),
    OneShot("similarity", clip_each_step=True),
    OneShot(clip_each_step=True, contradictions="majority"),
    ErrorDriven(epochs=3),
    ErrorDriven(epochs=3, average=True, contradictions="latest"),
    Gradient(epochs=3),
    Gradient(epochs=3, sparse=True, validation_fraction=0.2),
]


@pytest.mark.parametrize(
    ("rule", "name"),
    [(r, name) for r in RULES_AND_OPTIONS for name in ARCHITECTURES if r.supports(torchvsa.architecture(name, 8))],
    ids=str,
)
def test_learning_and_recall(there: Callable[..., None], rule: Rule, name: str) -> None:
    there(check_learning, rule, name)


def check_learning(rule: Rule, name: str) -> None:
    from pretended import moved

    here, away = (rule.fit(s, TWICE) for s in spaces(name))
    alike(here, away, exact=here.space.vsa.integer and rule.integer_programs)
    alike(here, moved(here), exact=True)
    alike(here.clipped(), away.clipped(), exact=False)
    alike(here.trainable(), away.trainable(), exact=False)
    answers_alike(here.freeze(), away.freeze())
    try:
        here = rule.partial_fit(here, random_pairs(20, seed=1))
    except ValueError:
        return  # it cannot go on
    alike(
        here, rule.partial_fit(away, random_pairs(20, seed=1)), exact=here.space.vsa.integer and rule.integer_programs
    )


def test_conditions_too_many_to_be_held(there: Callable[..., None]) -> None:
    there(check_unheld)


def check_unheld() -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("behaviours.learning.conditions.HELD_BYTES", 0)
        alike(*(OneShot("similarity").fit(s, TWICE) for s in spaces("MAP-C")), exact=True)


def spaces(name: str) -> list[Space]:
    """The same codebooks on both devices."""
    from pretended import NAME

    return [space(100, name).to(device) for device in ("cpu", NAME)]


def alike(here: Behaviour, away: Behaviour, exact: bool) -> None:
    """The same program on another device, with the same report and the same answers."""
    from pretended import brought_back

    assert here.report == away.report
    for mine, theirs in ((here.program, away.program), (here.known, away.known)):
        if exact:
            assert torch.equal(brought_back(theirs), mine)
        close(brought_back(theirs), mine, exact=False)
    answers_alike(here, away)
    close(brought_back(away.scores(SHOWN.sensors)), here.scores(SHOWN.sensors), exact=False)
    assert torch.equal(brought_back(away.labels(SHOWN.commands)), here.labels(SHOWN.commands))


def answers_alike(here: nn.Module, away: nn.Module) -> None:
    """The same answers, each where its module is."""
    from pretended import brought_back, waited

    away(SHOWN.sensors)  # the first call may fold the program, and look at its values
    waited.clear()
    mine, theirs = here(SHOWN.sensors), brought_back(away(SHOWN.sensors))
    assert waited == []
    close(theirs[1:], brought(mine[1:]), exact=False)
    clear = mine.margin > TOLERANCE  # where two results are as good as equal, either may win
    assert torch.equal(theirs[0][clear], mine.commands[clear])


def test_demonstrations_that_lie_there(there: Callable[..., None]) -> None:
    there(check_demonstrations)


def check_demonstrations() -> None:
    from pretended import moved

    shown = Demonstrations(moved(TWICE.sensors), moved(TWICE.commands))
    here, away = spaces("MAP-C")
    learned = OneShot().fit(here, TWICE)
    assert torch.equal(OneShot().fit(here, shown).program, learned.program)
    alike(learned, OneShot().fit(away, shown), exact=True)
    same(lambda behaviour, readings: behaviour(readings), learned, SHOWN.sensors, exact=False, waits=True)
    lost = torch.where(torch.rand(SHOWN.sensors.shape, generator=seeded(0)) < 0.3, torch.nan, SHOWN.sensors)
    episodes = torch.arange(40) // 13
    for hold in (False, True):
        same(lambda r, e, hold=hold: windows(r, e, [1, 3], hold), lost, episodes, waits=True)
    same(lambda readings: quantile_edges(readings, 5), SHOWN.sensors[:, 0], waits=True)
    assert len(shown.where([row < 5 for row in range(80)])) == 5
    history = History(here.encoder, [1])
    same(lambda encode, rows: encode(rows), history, history.windows(here.schema.normalise(SHOWN.sensors), episodes))


@pytest.mark.parametrize("policy", POLICIES.values(), ids=POLICIES.keys())
def test_policies_and_banks(
    there: Callable[..., None], policy: Callable[[BehaviourBank], Policy], tmp_path: Path
) -> None:
    there(check_policies, policy, tmp_path / "bank.safetensors")


def check_policies(policy: Callable[[BehaviourBank], Policy], path: Path) -> None:
    from pretended import moved

    banks = [BehaviourBank(s) for s in spaces("MAP-C")]
    for bank in banks:
        bank.learn("low", SHOWN.where([row < 20 for row in range(40)]), OneShot())
        bank.learn("high", SHOWN.where([row >= 20 for row in range(40)]), OneShot())
    here, away = (policy(bank) for bank in banks)
    answers_alike(here, away)
    answers_alike(here, moved(here))
    loaded = BehaviourBank.load(banks[1].save(path))
    assert torch.equal(loaded["low"].program, banks[0]["low"].program)
