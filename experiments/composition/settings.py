"""What the study of combination can be told."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import sim
from behaviours import Space
from experiments.composition.rows import ROWS, line_of, printed_space, rows_known
from experiments.kit import Part, part, parts, setting, settings
from experiments.tasks import corral
from experiments.tasks.behaviours import BEHAVIOURS

ARENAS = ["default", "narrow", "large", "offset_lamp", "clutter", "two_gaps"]


@dataclass
class Apart(corral.Learning):
    """How behaviours are demonstrated and learned apart."""

    encoder: Part = part("encoder", "level_wide", "the code of one reading")
    behaviours: list[str] = setting(
        list(sim.BEHAVIOURS), "what is learned apart; where several fire, the first of these is shown",
        choices=lambda: BEHAVIOURS, distinct=True,
    )  # fmt: skip
    demonstrations: int = corral.episodes(60, "episodes of the teacher to learn from")
    codebooks: int = setting(10, "draws of the codebooks; a start e is driven with codebook e mod this number", low=1)


@dataclass
class Combining(Apart):
    """How they are combined; several studies share it."""

    paper: corral.Paper = settings(corral.Paper, "the row paper_sum: the printed algorithms, read literally")
    evident: Part = part("rule", "evident", "how evident_sum learns: silent where only others know, louder by evidence")
    precedence: float = setting(2.4, "masked_sum: how much louder seek_light is than the others", above=0)


@dataclass
class Composition(Combining):
    """The settings of the study of policies."""

    rows: list[str] = setting(
        list(ROWS), "the rows of the table, in this order; any policy is one, too", choices=rows_known, distinct=True
    )
    bullet_rows: list[str] = setting(
        ["teacher", "joint_program", "evident_sum", "masked_priority"],
        "rows that drive in the physics engine, too, planar and on wheels", choices=rows_known, distinct=True,
        empty=True,
    )  # fmt: skip
    arenas: list[str] = setting(ARENAS, "where they drive; all learn in `default`", choices=sim.ARENAS, distinct=True)
    starts: int = corral.episodes(1000, "held-out starts in default and large, over all codebooks")
    other_starts: int = corral.episodes(500, "held-out starts in every other arena")
    bullet_starts: int = corral.episodes(200, "the first of these starts, in the physics engine, too, for bullet_rows")
    wheeled_starts: int = corral.episodes(50, "the same on the wheeled body", low=0)
    heldout: int = corral.episodes(200, "episodes of the teacher in each arena about which programs are asked")


def check(settings: Composition) -> None:
    """Raise for settings with which something could not be learned or driven."""
    if settings.engine != "vector":
        raise ValueError(f"engine={settings.engine}: name the rows for the physics engine, bullet_rows=[a,b]")
    corral.check_driving(settings, *(["bullet"] if settings.bullet_rows else []))
    check_rows(settings, settings.rows)
    for name in settings.arenas:
        if name not in corral.arenas():
            known = ", ".join(corral.arenas())
            raise ValueError(f"arenas: in {name} there is more than one light; choose from {known}")
    for name in settings.bullet_rows:
        if name not in settings.rows:
            raise ValueError(f"bullet_rows: {name} is not among the rows")


def check_rows(settings: Combining, names: Iterable[str]) -> Space:
    """The codebooks. Raises for rows that could not be learned or asked."""
    space = check_learning(settings)
    for name in names:
        try:
            if (record := line_of(name).record) is not None:
                corral.check_learning(replace(settings, record={"name": record}))
            if name == "paper_sum":
                parts.refuse_unsupported(parts.rule(settings.paper.rule, "paper.rule"), printed_space(settings, 0))
            if name == "oracle" and not space.encoder.discrete:
                raise ValueError(f"it asks each condition once, and record={settings.record['name']} has no bins")
        except ValueError as error:
            raise ValueError(f"rows: {name}: {error}") from error
    return space


def check_learning(settings: Combining) -> Space:
    """The codebooks. Raises for rules that cannot train the architecture's programs, or cannot keep silence."""
    space = corral.check_learning(settings)
    evident = parts.rule(settings.evident, "evident")
    parts.refuse_unsupported(evident, space)
    if not evident.supports_silence:
        raise ValueError(f"evident={evident.name} cannot keep silence; choose error_driven, least_squares or evident")
    return space


PRESETS = {
    "quick": {
        "rows": ["teacher", "joint_program", "plain_sum", "evident_sum", "masked_priority"],
        "bullet_rows": [],
        "arenas": ["default", "large"],
        "starts": 40,
        "heldout": 10,
        "codebooks": 2,
        "demonstrations": 20,
    },
}
