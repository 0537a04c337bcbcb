"""The rows of the study: policies that combine three behaviours learned apart, and references."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rich.progress import Progress

import sim
from behaviours import (
    POLICIES,
    Behaviour,
    BehaviourBank,
    Blending,
    Bundle,
    Controller,
    Demonstrations,
    Gated,
    Hierarchy,
    MotorSchema,
    Priority,
    Space,
    Vote,
    WinnerTakesAll,
    choosing,
)
from experiments.kit import parts
from experiments.kit.pool import measured
from experiments.models.baselines import CLASSIFIERS, Classified
from experiments.models.behaviour_tree import BehaviourTree
from experiments.tasks import corral
from experiments.tasks.asked_once import EachAskedOnce
from experiments.tasks.behaviours import Precedence

if TYPE_CHECKING:
    from experiments.composition.settings import Combining

PLAIN, EVIDENT, MASKED = "plain", "evident", "masked"
"""Kinds of banks, see `Shown.bank`."""
MASKS = {"seek_light": ["light_left", "light_right"], "avoid": ["distance"]}
"""The sensors that each behaviour uses in the rows `masked_*`: prior knowledge. `cruise` uses all."""


@dataclass(frozen=True)
class Shown:
    """What the rows learn from.

    Attributes:
        settings: of the run.
        train: moments of the teacher's runs in the arena `default`.
        banks: those that are learned already, by their kind and the draw of the codebooks (see `with_banks`).
    """

    settings: Combining
    train: Demonstrations
    banks: Mapping[tuple[str, int], BehaviourBank] = field(default_factory=dict)

    @functools.cached_property
    def rules(self) -> Precedence:
        """The behaviours, the first of which that fires drives."""
        return Precedence(self.settings.behaviours)

    @functools.cached_property
    def apart(self) -> dict[str, Demonstrations]:
        """The moments by the behaviour that fired."""
        return self.rules.apart(self.train)

    def space(self, codebook: int, record: str | None = None) -> Space:
        """One draw of the codebooks, with the run's record or another."""
        settings = self.settings
        chosen = settings.record if record is None else {"name": record}
        return parts.space(
            corral.schema(), settings.vsa, settings.encoder, chosen, settings.protection, settings.seed + codebook
        )

    def bank(self, codebook: int, kind: str = PLAIN, record: str | None = None) -> BehaviourBank:
        """The behaviours learned apart.

        In a `PLAIN` bank none knows of the others. In an `EVIDENT` one each is silent where only others know, and
        louder the more it has seen; in a `MASKED` one it also sees its own sensors only.
        """
        if record is None and (kind, codebook) in self.banks:
            return self.banks[kind, codebook]
        bank, settings = BehaviourBank(self.space(codebook, record)), self.settings
        if kind == PLAIN:
            bank.learn_apart(self.apart, parts.rule(settings.rule), silence=False)
        else:
            masks = {name: MASKS[name] for name in self.apart if name in MASKS} if kind == MASKED else None
            bank.learn_apart(self.apart, parts.rule(settings.evident), sensors=masks)
        return bank

    def with_banks(self, rows: Iterable[str], progress: Progress) -> Shown:
        """The same, with the banks of these rows learned for each draw of the codebooks, on all workers."""
        kinds = dict.fromkeys(kind for name in rows if (kind := line_of(name).bank) is not None)
        wanted = list(itertools.product(kinds, range(self.settings.codebooks)))
        task = progress.add_task("learn apart", total=len(wanted))
        banks = {}
        for place, bank in measured(_learned, self, wanted, self.settings.workers):
            banks[wanted[place]] = bank
            progress.advance(task)
        return replace(self, banks=banks)


def _learned(shown: Shown, which: tuple[str, int]) -> BehaviourBank:
    kind, codebook = which
    return shown.bank(codebook, kind)


def demonstrated(settings: Combining, progress: Progress) -> Shown:
    """Let the behaviours demonstrate in the arena `default`, the first that fires at each step."""
    first = corral.FIRST_DEMONSTRATION
    episodes = range(first, first + settings.demonstrations)
    rules = Precedence(settings.behaviours)
    return Shown(settings, corral.moving(corral.drive_together(settings, "demonstrations", rules, episodes, progress)))


@dataclass(frozen=True)
class Line:
    """One row of the table.

    Attributes:
        make: `make(shown, codebook)` returns what drives.
        about: what it is, in a few words.
        codebooks: whether it is made anew for each draw of the codebooks.
        memory: whether it has a memory.
        bank: the kind of bank that it is made of.
        record: the name of its record, where that is not the run's.
    """

    make: Callable[[Shown, int], Any]
    about: str
    codebooks: bool = True
    memory: bool = False
    bank: str | None = None
    record: str | None = None


def together(shown: Shown, codebook: int, record: str | None = None) -> Behaviour:
    """One program learned from all demonstrations."""
    return parts.rule(shown.settings.rule).fit(shown.space(codebook, record), shown.train)


def plain_sum(shown: Shown, codebook: int, record: str | None = None) -> Bundle:
    """The sum of programs that know nothing of each other."""
    return Bundle(shown.bank(codebook, record=record))


def evident_sum(shown: Shown, codebook: int) -> Bundle:
    """The sum of programs learned apart, each silent where only others know, and louder the more it has seen."""
    return Bundle(shown.bank(codebook, EVIDENT))


def masked_sum(shown: Shown, codebook: int) -> MotorSchema:
    """The scores of behaviours that see their own sensors only, with precedence for the light."""
    loud = {name: shown.settings.precedence for name in ("seek_light",) if name in shown.apart}
    return MotorSchema(shown.bank(codebook, MASKED), loud, familiarity=False)


def hierarchy_trained(shown: Shown, codebook: int) -> Hierarchy:
    """One vector that also holds a program, trained on the moments of all behaviours, that recalls whom to ask."""
    bank = shown.bank(codebook)
    return Hierarchy(bank, choosing(bank, shown.apart, parts.rule(shown.settings.rule)))


def printed_space(settings: Combining, codebook: int) -> Space:
    """One draw of the printed codebooks."""
    printed, seed = settings.paper, settings.seed + codebook
    encoder = {**printed.encoder, "bins": settings.encoder.get("bins", 32)}
    return parts.space(corral.schema(), settings.vsa, encoder, printed.record, printed.protection, seed)


def paper_sum(shown: Shown, codebook: int) -> Behaviour:
    """The printed algorithms: each program clipped at every step, and so is their sum."""
    space, rule = printed_space(shown.settings, codebook), parts.rule(shown.settings.paper.rule)
    return Behaviour.sum([rule.fit(space, samples) for samples in shown.apart.values()]).clipped()


class Oracle:
    """Asks the program of the behaviour that fires first."""

    def __init__(self, rules: Precedence, banks: list[BehaviourBank]) -> None:
        self.rules, self.names = rules, banks[0].names
        self.parts = [EachAskedOnce([bank[name] for bank in banks]) for name in self.names]

    def start(self, episodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """The codebook of each episode."""
        return self.parts[0].start(episodes)

    def step(
        self, readings: NDArray[np.float64], which: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Commands `[B, 2]`."""
        first = self.rules.first(readings)
        commands = np.zeros((len(readings), len(sim.ACTUATORS)))
        for number, part in enumerate(self.parts):
            rows = first == number
            if rows.any():
                commands[rows] = part.step(readings[rows], which[rows])[0].commands.numpy()
        return commands, which


def plain(made: Callable[[BehaviourBank], Controller], about: str, memory: bool = False) -> Line:
    """A policy over behaviours that know nothing of each other."""
    return Line(lambda shown, codebook: made(shown.bank(codebook)), about, memory=memory, bank=PLAIN)


def masked(made: Callable[[BehaviourBank], Controller], about: str) -> Line:
    """A policy over behaviours that see their own sensors only, and are silent where only others know."""
    return Line(lambda shown, codebook: made(shown.bank(codebook, MASKED)), about, bank=MASKED)


ROWS: dict[str, Line] = {
    "teacher": Line(lambda shown, codebook: shown.rules, "the rules that were shown", codebooks=False),
    "nearest_neighbour": Line(
        lambda shown, codebook: Classified(CLASSIFIERS["nearest_neighbour"](shown.settings.seed), shown.train),
        "all demonstrations kept",
        codebooks=False,
    ),
    "oracle": Line(
        lambda shown, codebook: Oracle(shown.rules, [shown.bank(each) for each in range(shown.settings.codebooks)]),
        "separate programs; the teacher's rules say which one is asked",
        codebooks=False,
        bank=PLAIN,
    ),
    "joint_program": Line(together, "one program learned from all demonstrations"),
    "evident_sum": Line(
        evident_sum, "a plain sum of programs learned apart, silent where only others know", bank=EVIDENT
    ),
    "masked_priority": masked(
        lambda bank: Priority(bank, by="similarity"),
        "each behaviour sees its own sensors; the first whose answer is clear speaks",
    ),
    "masked_winner": masked(WinnerTakesAll, "each behaviour sees its own sensors; the one that knows best speaks"),
    "masked_sum": Line(
        masked_sum, "each behaviour sees its own sensors; scores are added, those of seek louder", bank=MASKED
    ),
    "behaviour_tree": masked(
        lambda bank: BehaviourTree(bank, by="similarity"),
        "masked_priority as a selector of py_trees; the last one speaks where no answer is clear",
    ),
    "plain_sum": Line(plain_sum, "the sum of programs that know nothing of each other", bank=PLAIN),
    "priority": plain(Priority, "the first that knows the condition speaks"),
    "winner_takes_all": plain(WinnerTakesAll, "the one that knows the condition best speaks"),
    "gated": plain(Gated, "one vector, asked with the context of the one that knows best"),
    "hierarchy": plain(Hierarchy, "one vector that also recalls whom to ask, from what each knows"),
    "hierarchy_trained": Line(
        hierarchy_trained, "one vector that also recalls whom to ask, with a trained program", bank=PLAIN
    ),
    "motor_schema": plain(MotorSchema, "scores weighted by familiarity"),
    "blending": plain(Blending, "commands weighted by familiarity"),
    "vote": plain(Vote, "the majority of commands"),
    "paper_sum": Line(paper_sum, "the printed algorithms: programs and sum clipped"),
    "joint_sum_record": Line(
        lambda *given: together(*given, record="sum"), "joint_program with sensors bundled", record="sum"
    ),
    "plain_sum_record": Line(
        lambda *given: plain_sum(*given, record="sum"), "plain_sum with sensors bundled", record="sum"
    ),
    "joint_subset_record": Line(
        lambda *given: together(*given, record="subset_product"),
        "joint_program with a subset of sensors per element",
        record="subset_product",
    ),
    "plain_subset_record": Line(
        lambda *given: plain_sum(*given, record="subset_product"),
        "plain_sum with a subset of sensors per element",
        record="subset_product",
    ),
}
"""All rows by name."""


def rows_known() -> list[str]:
    """What can be a row: those above, and every other policy by its name, over behaviours learned apart."""
    return list(dict.fromkeys([*ROWS, *POLICIES]))


def line_of(name: str) -> Line:
    """The row of this name."""
    if name in ROWS:
        return ROWS[name]
    made = POLICIES.find(name)
    about = next(iter((made.__doc__ or name).splitlines()))
    return plain(made, about, memory=getattr(made, "start", None) is not Controller.start)
