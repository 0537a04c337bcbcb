"""Can one vector do one thing after the other, the second of which was never demonstrated?

A robot in an arena with two lamps has to touch the blue one, then stay at the yellow one. It was shown only how to go
to the blue lamp: the way to the yellow one is the mirror image of that program. Both programs, a context for each and
the transition between them are one hypervector.

    torchvsa sequence
    torchvsa sequence arenas=[lamp_room] starts=100 bullet_starts=0 wheeled_starts=0
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

import sim
from behaviours import Demonstrations, ErrorDriven
from behaviours.learning import no_convergence_warnings
from experiments.composition import sequence_paths
from experiments.kit import Cell, Column, Drawing, Outcome, Page, Row, Settings, Study, Table, grid, setting
from experiments.kit.intervals import mean
from experiments.kit.study import plain_page
from experiments.tasks import corral
from experiments.tasks import two_lamps as task
from experiments.tasks.agreement import share_right
from experiments.tasks.in_bullet import TWINS, twin_starts

TEACHER, VECTOR, COMMON = "teacher", "one_vector", "one_vector_common"
"""The rows of the table: five rules for each lamp in turn; one hypervector; the same from starts the teacher solves."""
MOST_CODEBOOKS = 1000


@dataclass
class Sequence(Settings):
    """The settings of this study."""

    arenas: list[str] = setting(
        ["lamp_room", "two_lamps"], "where they learn and drive", choices=sim.ARENAS, distinct=True
    )
    starts: int = corral.episodes(500, "held-out starts, divided among the codebooks")
    bullet_starts: int = corral.episodes(200, "the first of them that are driven in the physics engine, too", low=0)
    wheeled_starts: int = corral.episodes(50, "the same on the wheeled body", low=0)
    codebooks: int = setting(10, "draws of codebooks and contexts", low=1, high=MOST_CODEBOOKS)
    demonstrations: int = corral.episodes(20, "runs of the teacher to the blue lamp to learn from")
    heldout: int = corral.episodes(200, "runs of the teacher to the yellow lamp about which 'to yellow' is asked")
    seconds: float = setting(120.0, "longest duration of an episode, s; of a run to one lamp, half of it", above=0)
    dim: int = setting(4000, "elements of the hypervector; even, since a mirror image is a rotation by half", low=2)
    bins: int = setting(32, "bins per sensor", low=2)
    margin: float = setting(0.5, "lead that counts as correct when 'to blue' is learned, in stored pairs", low=0)
    switching_margin: float = setting(5.0, "the same for the transition", low=0)


def check(settings: Sequence) -> None:
    """Raise for arenas without the two lamps, and for fewer starts than codebooks."""
    fit = [name for name in sim.ARENAS if sim.Task.of(sim.find_arena(name)) == task.TASK]
    for name in settings.arenas:
        if name not in fit:
            raise ValueError(f"arenas: {name} has no blue lamp and then a yellow one; choose from {', '.join(fit)}")
    for name in ("starts", "bullet_starts", "wheeled_starts"):
        if 0 < (given := getattr(settings, name)) < settings.codebooks or (name == "starts" and not given):
            raise ValueError(f"{name}={given}: expected at least one for each of codebooks={settings.codebooks}")
    if settings.dim % 2:
        raise ValueError(f"dim={settings.dim}: expected an even number")


def cells(settings: Sequence) -> list[Cell]:
    """A cell for each arena and codebook, and one for the teacher (codebook null)."""
    return grid(arena=settings.arenas, codebook=[None, *range(settings.codebooks)])


@dataclass(frozen=True)
class Material:
    """What all cells share.

    Attributes:
        settings: of the run.
        folder: where paths are kept.
        taught: runs to the blue lamp, by arena.
        asked: moments of held-out runs on their way to the yellow lamp, by arena.
    """

    settings: Sequence
    folder: Path
    taught: dict[str, task.Runs]
    asked: dict[str, Demonstrations]


def prepare(settings: Sequence, folder: Path, progress: Any) -> Material:
    """Let the teacher drive to the blue lamp, from starts that are not tested, and to the yellow one from those."""
    first, seconds = corral.FIRST_DEMONSTRATION, settings.seconds / 2
    taught, asked = {}, {}
    for arena in settings.arenas:
        episodes = range(first, first + settings.demonstrations)
        taught[arena] = task.runs(arena, "blue", episodes, settings.seed, seconds)
        held = task.runs(arena, "yellow", range(settings.heldout), settings.seed, seconds)
        asked[arena] = held.shown.where(~held.arrived)
    return Material(settings, folder, taught, asked)


def measure(material: Material, cell: Cell) -> list[Row]:
    """For each engine and start, whether the robot touches the blue lamp and then stays at the yellow one.

    `agreement`, the same in all rows of a codebook, is the share of held-out moments in which 'to yellow' commands what
    the teacher does.
    """
    settings, arena, codebook = material.settings, cell["arena"], cell["codebook"]
    if codebook is None:
        return drive(settings, arena, sim.InOrder(task.TASK))
    taught, seed = material.taught[arena], MOST_CODEBOOKS * settings.seed + codebook
    with no_convergence_warnings():
        both = task.bank(task.space(settings.dim, settings.bins, seed), taught, ErrorDriven(settings.margin))
        policy = task.policy(both, taught, ErrorDriven(settings.switching_margin), seed)
    if codebook == 0:
        sequence_paths.write(material.folder, arena, policy, settings.seed, settings.seconds)
    agreement = share_right(both["to yellow"], material.asked[arena])
    rows = drive(settings, arena, task.AskedOnce(policy), codebook)
    return [{**row, "agreement": agreement} for row in rows]


def drive(settings: Sequence, arena: str, controller: sim.ControllerLike, codebook: int | None = None) -> list[Row]:
    """A row for each engine and start; a codebook has every start whose number is it modulo their count."""
    rows = []
    counts = {"vector": settings.starts, **{twin: twin_starts(settings, twin) for twin in TWINS}}
    for engine, count in counts.items():
        if count:
            chosen = range(count) if codebook is None else range(codebook, count, settings.codebooks)
            driven = sim.rollout(
                controller, arena, task=task.TASK, episodes=chosen, seed=settings.seed,
                seconds=settings.seconds, engine="bullet" if engine in TWINS else engine, body=TWINS.get(engine),
                record=False,
            )  # fmt: skip
            for start, success in zip(driven.episode.tolist(), driven.success.tolist(), strict=True):
                row = TEACHER if codebook is None else VECTOR
                rows.append({"engine": engine, "row": row, "episode": start, "success": success})
    return rows


def summarise(settings: Sequence, records: pd.DataFrame) -> list[Row]:
    """A row for each arena, engine and controller; the last one counts only starts where the teacher succeeds."""
    table: list[Row] = []
    for cell in grid(arena=settings.arenas, engine=records.engine.unique()):
        here = records.loc[(records.arena == cell["arena"]) & (records.engine == cell["engine"])]
        rows = {name: here.loc[here.row == name].set_index("episode") for name in (TEACHER, VECTOR)}
        solved = rows[TEACHER].index[rows[TEACHER].success]
        rows[COMMON] = rows[VECTOR].loc[solved]
        for name, own in rows.items():
            row = {**cell, "row": name, **corral.success(len(own), int(own.success.sum()))}
            if cell["engine"] != "vector":
                driver = TEACHER if name == TEACHER else VECTOR
                before = records.loc[
                    (records.arena == cell["arena"]) & (records.engine == "vector") & (records.row == driver)
                ].set_index("episode")
                row |= mean("minus_vector", own.success.astype(float) - before.success.loc[own.index].astype(float))
            if name == VECTOR and cell["engine"] == "vector":
                shares = own.groupby("codebook").agreement.first()
                row |= mean("agreement", shares)
            table.append(row)
    return table


def headline(outcome: Outcome) -> str:
    """From how many starts one vector and the teacher do both."""
    found = {(row["arena"], row["row"]): row for row in outcome.table if row["engine"] == "vector"}
    words = [
        f"in {arena} from {found[arena, VECTOR]['success_rate']:.1%} of {found[arena, VECTOR]['episodes']:,} starts "
        f"(its teacher from {found[arena, TEACHER]['success_rate']:.1%})"
        for arena in outcome.settings.arenas
    ]
    return f"One vector goes to the blue lamp and then to the yellow one, which was never shown: {'; '.join(words)}."


def page(page: Page, outcome: Outcome, study: Study) -> None:
    """The usual page, and an animation in each arena."""
    plain_page(page, outcome, study)
    sequence_paths.animations(page, outcome)


TABLE = Table(
    "First blue, then yellow",
    [
        Column("row", about="one_vector_common: one_vector from the starts where the teacher succeeds"),
        Column("arena"),
        Column("engine"),
        Column("episodes", "starts", ",d"),
        Column("success_rate", "success", ".3f", interval=("success_low", "success_high"), about=(
            "robots that touch the blue lamp and then stay at the yellow one, with Wilson's 95 % interval"
        )),
        Column("minus_vector", "less vector", "+.3f", ("minus_vector_low", "minus_vector_high"), about=(
            "success in the physics engine, planar (bullet) or on wheels, less that in vector, from the same starts "
            "with the same codebooks and wheel noise; bootstrap over the starts"
        )),
        Column("agreement", format=".3f", interval=("agreement_low", "agreement_high"), about=(
            "share of the teacher's moments on its way to the yellow lamp in which 'to yellow' commands the same, mean "
            "over codebooks, with their bootstrap"
        )),
    ],
)  # fmt: skip
METHOD = """
The teacher drives to the blue lamp only, in the same arena, from starts that are not tested. 'To blue' learns from
these runs, with its own pair of light sensors and the distance. In the codes one involution swaps the colours: the
mirror image of the program is 'to yellow', which nobody demonstrated. The transition is learned from the same readings:
at the blue lamp, hand over; before it, go on.

Start e is driven with codebook e mod their number. All rows of an arena and an engine drive from the same starts, with
the same wheel noise.
"""
QUICK = {"arenas": ["lamp_room"], "starts": 20, "bullet_starts": 0, "wheeled_starts": 0, "codebooks": 2, "heldout": 20}

study = Study(
    name="sequence",
    about="Can one vector do one thing after the other, the second of which was never demonstrated?",
    settings=Sequence,
    check=check,
    cells=cells,
    prepare=prepare,
    measure=measure,
    summarise=summarise,
    keys=("arena", "engine", "row"),
    table=TABLE,
    figures=[
        Drawing(
            "paths", sequence_paths.draw, "paths in each arena, coloured by the behaviour that speaks",
            "Paths of one vector, coloured by the behaviour that speaks. A circle marks each start, a cross the end of "
            "an episode without success.",
        ),
    ],
    headline=headline,
    method=METHOD,
    page=page,
    presets={"quick": QUICK},
    objective="lamp_room.vector.one_vector.success_rate",
)  # fmt: skip
