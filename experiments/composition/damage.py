"""Does a combination of behaviours survive damage as well as one program does?

The paper claims that hypervector behaviours keep their robustness when they are combined. Here a share of the elements
of all vectors that a row keeps has its sign flipped, or the robot's sensors are noisy; each row drives and is asked
about moments of the teacher.

    torchvsa damage
    torchvsa damage rows=[joint_program,evident_sum] noise=[]
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
import torch
from rich.progress import Progress
from torch import Tensor

from behaviours import Behaviour, Bundle, Demonstrations, Gated, Policy
from behaviours.learning import no_convergence_warnings
from experiments.composition.measure import success_interval
from experiments.composition.rows import Shown, demonstrated, line_of, rows_known
from experiments.composition.settings import Combining, check_rows
from experiments.kit import Cell, Column, Drawing, Outcome, Part, Row, Study, Table, grid, part, setting
from experiments.kit.figures import legend_below, lines
from experiments.kit.intervals import mean
from experiments.models.damage import Array, Damage
from experiments.models.disturbances import Disturbed, Noisy, disturb_in_turns
from experiments.tasks import corral, in_bullet
from experiments.tasks.asked_once import EachAskedOnce

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FLIPPED, NOISY = "elements flipped", "sensors noisy"
KEYS = ("row", "damage", "level")


@dataclass
class Damaged(Combining, in_bullet.InBullet):
    """The settings of this study."""

    arena: Part = part("arena", "default", "where they are asked and drive; all learn in `default`")
    rows: list[str] = setting(
        ["joint_program", "evident_sum", "plain_sum", "gated", "priority", "masked_priority", "masked_sum"],
        "rows of the table, as in the study composition", choices=rows_known, distinct=True,
    )  # fmt: skip
    flips: list[float] = setting([0.1, 0.2, 0.3, 0.4], "shares of elements flipped", low=0, high=1, distinct=True)
    noise: list[float] = setting(
        [0.02, 0.05, 0.1], "standard deviations of the sensors' noise, as shares of their ranges",
        low=0, distinct=True, empty=True,
    )  # fmt: skip
    bullet_rows: list[str] = setting(
        ["joint_program", "evident_sum"], "those of the rows that drive in the physics engine, too",
        choices=rows_known, distinct=True, empty=True,
    )  # fmt: skip
    bullet_flips: list[float] = setting(
        [0.0, 0.3], "those of the flips with which they do; 0: undamaged", low=0, high=1, distinct=True, empty=True
    )
    bullet_noise: list[float] = setting([0.1], "and those of the noise", above=0, distinct=True, empty=True)
    starts: int = corral.episodes(200, "held-out starts, over all codebooks")
    heldout: int = corral.episodes(100, "episodes of the teacher about which programs are asked")
    kept: float = setting(0.95, "a level is survived if this share of the undamaged agreement is left", above=0, high=1)


def check(settings: Damaged) -> None:
    """Raise for what cannot be learned, and for rows without vectors that can be damaged."""
    space = check_rows(settings, settings.rows)
    corral.arena(settings.arena)
    in_bullet.check(settings, bool(set(settings.rows) & set(settings.bullet_rows)))
    if space.vsa.dtype == torch.bool or space.vsa.dtype.is_complex:
        raise ValueError(f"damage flips the signs of real numbers, of which {space.vsa.name} has none; try vsa=map_c")
    if not space.encoder.discrete:
        raise ValueError(f"record={settings.record['name']}: damage asks each condition once, and it has no bins")
    for name in settings.rows:
        if not line_of(name).codebooks or line_of(name).memory:
            raise ValueError(f"rows: {name} cannot be damaged, since it keeps no hypervectors or has a memory")


@dataclass(frozen=True)
class Material:
    """What all cells share: the settings, what is learned from, and the teacher's held-out runs."""

    settings: Damaged
    shown: Shown
    heldout: Demonstrations


def prepare(settings: Damaged, folder: Path, progress: Progress) -> Material:
    """Let the teacher drive in the arena of the settings."""
    shown = demonstrated(settings, progress).with_banks(settings.rows, progress)
    where = corral.arena(settings.arena)
    asked = corral.drive_together(settings, "held out", shown.rules, range(settings.heldout), progress, where)
    return Material(settings, shown, corral.moving(asked))


def cells(settings: Damaged) -> list[Cell]:
    """A cell for each row."""
    return grid(row=settings.rows)


def vectors(controller: Any) -> list[Tensor]:
    """The vectors on which a controller's answers depend: programs, and sums of known conditions if they are asked."""
    match controller:
        case Behaviour():
            return [controller.program]
        case Bundle():
            return [controller.program]
        case Gated():
            return [controller.program, *(part.known for part in controller.parts)]
        case Policy():
            return [vector for part in controller.parts for vector in (part.program, part.known)]
        case _:
            raise TypeError(f"{type(controller).__name__} keeps no hypervectors")


def flipped(controller: Any, share: float, seed: tuple[int, ...]) -> Any:
    """A copy of a controller with the signs of a share of all its elements flipped."""
    made = copy.deepcopy(controller)
    kept = vectors(made)
    damaged = Damage("flip", share, 0.0, seed)([Array(vector.double().numpy()) for vector in kept])
    for vector, values in zip(kept, damaged, strict=True):
        vector.copy_(torch.from_numpy(values))
    return made


def measure(material: Material, cell: Cell) -> list[Row]:
    """A record for each damage, level and codebook: success and agreement."""
    settings, line = material.settings, line_of(cell["row"])
    with no_convergence_warnings():
        made = [line.make(material.shown, codebook) for codebook in range(settings.codebooks)]
    found = []
    for level in (0.0, *settings.flips):
        copies = [flipped(one, level, (settings.seed, number)) for number, one in enumerate(made)]
        found += driven(material, EachAskedOnce(copies), 0.0, {**cell, "damage": FLIPPED, "level": level})
    each = EachAskedOnce(made)
    for level in settings.noise:
        found += driven(material, each, level, {**cell, "damage": NOISY, "level": level})
    # What is not damaged at all is the beginning of both.
    first = [row for row in found if row["level"] == 0]
    return found + [{**row, "damage": NOISY} for row in first if settings.noise]


def driven(material: Material, each: EachAskedOnce, noise: float, factors: Row) -> list[Row]:
    """A record for each codebook; episode e belongs to codebook e mod their number."""
    settings, heldout, levels = material.settings, material.heldout, corral.schema().command_levels
    disturbance, episodes = Noisy(noise, settings.seed), heldout.episodes.numpy()
    owner = episodes % settings.codebooks
    # The held-out moments first: many conditions are asked faster at once.
    answer, _ = each.step(disturb_in_turns([disturbance], heldout.sensors.numpy(), episodes), owner)
    right = (levels(answer.commands) == levels(heldout.commands)).all(-1).numpy()
    driver = Disturbed(disturbance, each)
    where = corral.arena(settings.arena)
    run = corral.drive(settings, driver, range(settings.starts), where)
    again = in_bullet.effects(settings, driver, run, where) if in_both(settings, factors) else {}
    return [
        {
            **factors,
            "codebook": codebook,
            "episodes": int((run.episode % settings.codebooks == codebook).sum()),
            "successes": int(run.success[run.episode % settings.codebooks == codebook].sum()),
            "agreement": float(right[owner == codebook].mean()) if (owner == codebook).any() else None,
            **in_bullet.counted({body: effects[codebook :: settings.codebooks] for body, effects in again.items()}),
        }
        for codebook in range(settings.codebooks)
    ]


def in_both(settings: Damaged, factors: Row) -> bool:
    """Whether robots of a row drive with this damage in the physics engine, too."""
    levels = settings.bullet_flips if factors["damage"] == FLIPPED else settings.bullet_noise
    return factors["row"] in settings.bullet_rows and factors["level"] in levels


def summarise(settings: Damaged, records: pd.DataFrame) -> list[Row]:
    """A row for each line, damage and level, with the share of the undamaged agreement that is left."""
    table: list[Row] = []
    levels = {FLIPPED: settings.flips, NOISY: settings.noise}
    for name in settings.rows:
        for damage, those in levels.items():
            whole: float | None = None
            for level in [0.0, *those] if those else []:
                chosen = (records.row == name) & (records.damage == damage) & (records.level == level)
                own = records.loc[chosen]
                low, high = success_interval(own)
                agreement = own.agreement.dropna().astype(float).to_numpy()
                whole = float(agreement.mean()) if whole is None else whole
                table.append(
                    {
                        "row": name, "damage": damage, "level": level, "starts": int(own.episodes.sum()),
                        "success_rate": own.successes.sum() / own.episodes.sum(), "success_low": low,
                        "success_high": high, **mean("agreement", agreement),
                        "agreement_least": float(agreement.min()),
                        "kept": float(agreement.mean()) / whole, **in_bullet.differences(own),
                    }
                )  # fmt: skip
    return table


def survived(outcome: Outcome, damage: str) -> dict[str, float]:
    """For each row, the largest level up to which every level is survived."""
    found = {}
    for name in outcome.settings.rows:
        levels = [row for row in outcome.table if (row["row"], row["damage"]) == (name, damage)]
        good = [row["kept"] >= outcome.settings.kept for row in levels]
        found[name] = levels[(good.index(False) if False in good else len(good)) - 1]["level"] if levels else 0.0
    return found


def headline(outcome: Outcome) -> str:
    """How many flipped elements each row survives."""
    shares = ", ".join(f"`{name}` {share:.0%}" for name, share in survived(outcome, FLIPPED).items())
    return f"With {outcome.settings.kept:.0%} of its agreement left, each row survives flipped elements: {shares}."


def curves(outcome: Outcome) -> Figure:
    """Agreement and success against the level, for both kinds of damage."""
    from matplotlib.figure import Figure

    frame = pd.DataFrame(outcome.table)
    kinds = [kind for kind in (FLIPPED, NOISY) if (frame.damage == kind).any()]
    figure = Figure(figsize=(5.2 * len(kinds), 6.6), layout="constrained")
    panels = figure.subplots(2, len(kinds), sharey="row", sharex="col", squeeze=False)
    columns = (("agreement", "agreement_low", "agreement_high"), ("success_rate", "success_low", "success_high"))
    for across, kind in enumerate(kinds):
        own = frame.loc[frame.damage == kind]
        for down, (value, low, high) in enumerate(columns):
            axes = panels[down, across]
            lines(axes, own, "level", value, "row", order=outcome.settings.rows, low=low, high=high)
            axes.set(ylabel=value.replace("_rate", ""), title=kind if not down else "")
            axes.set_ylim(0, 1.03)
        panels[1, across].set_xlabel("share of elements" if kind == FLIPPED else "noise, share of the sensor's range")
    legend_below(figure, panels[0, 0])
    return figure


def tables(outcome: Outcome) -> list[Table]:
    """What was measured; and the same in the physics engine, where what is not damaged at all is one row."""
    once = [row for row in outcome.table if row["level"] or row["damage"] == FLIPPED]
    driven = [row if row["level"] else {**row, "damage": None} for row in once]
    about = (
        "The first starts of `bullet_rows`, undamaged and with `bullet_flips` and `bullet_noise`, of all codebooks; "
        "those of one codebook are taken as independent, so that the intervals are somewhat too narrow."
    )
    return [TABLE.show(outcome.table), *in_bullet.tables(KEY_COLUMNS, driven, about)]


KEY_COLUMNS = [
    Column("row"),
    Column("damage"),
    Column("level", format=".2f", about="share of elements, or of the sensor's range"),
]
TABLE = Table(
    "What damage leaves",
    [
        *KEY_COLUMNS,
        Column("success_rate", "success", ".3f", interval=("success_low", "success_high"), about=(
            "robots at the lamp at the end; the wider of Wilson's interval and the bootstrap over codebooks"
        )),
        Column("agreement", format=".3f", interval=("agreement_low", "agreement_high"), about=(
            "share of the teacher's moments with its commands, mean over codebooks, with their bootstrap"
        )),
        Column("agreement_least", "worst", ".3f", about="that of the worst codebook"),
        Column("kept", format=".3f", about="share of the undamaged agreement that is left"),
    ],
)  # fmt: skip
METHOD = """
Rows are those of the study composition. A share of the elements of all vectors on which a row's answers depend has its
sign flipped, drawn anew for each codebook: of one sum its program; of a gated vector that and the sums of known
conditions that say who is asked; of policies that ask all behaviours each program and each of those sums. Or Gaussian
noise is added to each reading at each step, and the result clipped to the sensor's range; the teacher that is agreed
with sees true readings. Nothing is learned from damaged vectors or readings.
"""

study = Study(
    name="damage",
    about="Does a combination of behaviours survive damage as well as one program does?",
    settings=Damaged,
    check=check,
    cells=cells,
    prepare=prepare,
    measure=measure,
    summarise=summarise,
    keys=KEYS,
    tables=tables,
    figures=[
        Drawing("damage", curves, "agreement and success against the share of damage, a line for each row",
                "Bands: 95 % intervals over starts and codebooks."),
    ],
    headline=headline,
    method=METHOD,
    presets={"quick": {
        "rows": ["joint_program", "evident_sum", "gated"], "flips": [0.2, 0.4], "noise": [0.05], "starts": 40,
        "heldout": 10, "codebooks": 2, "demonstrations": 20, "bullet_starts": 0, "wheeled_starts": 0,
    }},
)  # fmt: skip
