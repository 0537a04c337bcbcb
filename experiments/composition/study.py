"""What are good policies to combine behaviours? The paper's last question, asked of one robot in six arenas.

Three behaviours are learned apart from runs of the teacher in one arena, and combined by each policy. Every row drives
from held-out starts in every arena, over several draws of the codebooks, and is asked about moments of the teacher.

    torchvsa composition
    torchvsa composition rows=[teacher,joint_program,evident_sum] arenas=[default,large]
"""

from __future__ import annotations

import pandas as pd

from experiments.composition import figures
from experiments.composition.measure import measure, prepare, success_interval
from experiments.composition.rows import line_of
from experiments.composition.settings import PRESETS, Composition, check
from experiments.kit import Cell, Column, Drawing, Outcome, Page, Row, Study, Table, grid
from experiments.kit.intervals import mean
from experiments.kit.study import plain_page
from experiments.tasks.in_bullet import TWINS, twin_starts


def cells(settings: Composition) -> list[Cell]:
    """A cell for each row, and for those that drive in the physics engine, too; these take longest."""
    twins = [engine for engine in reversed(TWINS) if twin_starts(settings, engine)]
    return grid(engine=[*twins], row=settings.bullet_rows) + grid(row=settings.rows, engine=["vector"])


def summarise(settings: Composition, records: pd.DataFrame) -> list[Row]:
    """A row for each line, arena and engine."""
    table: list[Row] = []
    for cell in cells(settings):
        for arena in settings.arenas:
            chosen = (records.row == cell["row"]) & (records.engine == cell["engine"]) & (records.arena == arena)
            own = records.loc[chosen]
            name = cell["row"] if cell["engine"] == "vector" else f"{cell['row']}_{cell['engine']}"
            low, high = success_interval(own)
            row = {
                "row": name, "arena": arena, "starts": int(own.episodes.sum()),
                "success_rate": own.successes.sum() / own.episodes.sum(), "success_low": low, "success_high": high,
                "collisions": float((own.collisions * own.episodes).sum() / own.episodes.sum()),
            }  # fmt: skip
            if cell["engine"] == "vector":
                for column in ("agreement", "agreement_avoid", "agreement_distinct"):
                    row |= {**mean(column, own[column].dropna()), f"{column}_least": own[column].min()}
                row["ceiling"] = own.ceiling.iloc[0]
            else:
                twin = (records.row == cell["row"]) & (records.engine == "vector") & (records.arena == arena)
                before = records.loc[twin, f"{cell['engine']}_successes"].sum()
                row["minus_vector"] = float(own.successes.sum() - before) / row["starts"]
            table.append(row)
    order = [*settings.rows, *(f"{name}_{engine}" for engine in TWINS for name in settings.bullet_rows)]
    return sorted(table, key=lambda row: order.index(row["row"]))


def headline(outcome: Outcome) -> str:
    """How near a plain sum comes to joint training, and how far masked behaviours reach."""
    found = {(row["row"], row["arena"]): row for row in outcome.table}
    arenas, words = outcome.settings.arenas, []
    if {"evident_sum", "joint_program"} <= set(outcome.settings.rows):
        gap = max(
            abs(found["evident_sum", arena]["agreement"] - found["joint_program", arena]["agreement"])
            for arena in arenas
        )
        words.append(
            "A plain sum of programs learned apart agrees with the teacher as one program learned jointly does, "
            f"within {gap:.3f} in every arena"
        )
    if "large" in arenas and "masked_sum" in outcome.settings.rows:
        rate = found["masked_sum", "large"]["success_rate"]
        words.append(f"behaviours that see only their own sensors succeed from {rate:.1%} of the starts in large")
    return "; ".join(words) + "." if words else ""


def tables(outcome: Outcome) -> list[Table]:
    """A table for each arena."""
    shown = []
    for arena in outcome.settings.arenas:
        rows = [row for row in outcome.table if row["arena"] == arena]
        shown.append(Table(f"Arena {arena}", COLUMNS).show(rows))
    rows = [{"row": name, "about": line_of(name).about} for name in outcome.settings.rows]
    return [*shown, Table("What the rows are", [Column("row"), Column("about", "what it is")], words=True).show(rows)]


def page(page: Page, outcome: Outcome, study: Study) -> None:
    """The usual page, and an animation of each policy."""
    plain_page(page, outcome, study)
    figures.animations(page, outcome)


COLUMNS = [
    Column("row"),
    Column("starts", format=",d"),
    Column("success_rate", "success", ".3f", interval=("success_low", "success_high"), about=(
        "robots at the lamp at the end; the wider of Wilson's interval over starts and the bootstrap's over codebooks"
    )),
    Column("minus_vector", "less vector", "+.3f", about=(
        "success less that of the same row in `vector`, from the same first starts with the same wheel noise"
    )),
    Column("agreement", format=".3f", interval=("agreement_low", "agreement_high"), about=(
        "share of the teacher's moments with its commands, mean over codebooks, with their bootstrap"
    )),
    Column("agreement_avoid", "avoid", ".3f", interval=("agreement_avoid_low", "agreement_avoid_high"), about=(
        "the same where the teacher avoids an obstacle"
    )),
    Column("agreement_avoid_least", "worst", ".3f", about="that of the worst codebook"),
    Column("agreement_distinct", "by cell", ".3f", about="agreement with each distinct condition counted once"),
    Column("ceiling", format=".3f", about="agreement of the best function of the bins"),
    Column("collisions", "contact", ".3f", about="share of control steps in contact with an obstacle"),
]  # fmt: skip

METHOD = """
The teacher drives in the arena `default`; these runs are all that is shown. Three behaviours (seek light, avoid,
cruise) learn from the moments in which their own rules fired. Rows that end in `_bullet` and `_wheeled` repeat others
in the physics engine, with the planar and the wheeled body.

Start e drives with codebook e mod their number: an interval counts both. Agreement is over moments of 200 held-out runs
of the teacher in the same arena, before it reaches the lamp.

Where the teacher fails (clutter, two_gaps), success does not rank policies: judge those arenas by agreement.

Masks (`masked_*`, `behaviour_tree`) are prior knowledge that the other rows do not have: seek sees the lights, avoid
the distance. These behaviours learn as those of `evident_sum` do.
"""

study = Study(
    name="composition",
    about="What are good policies to combine several behaviours?",
    settings=Composition,
    cells=cells,
    prepare=prepare,
    measure=measure,
    summarise=summarise,
    keys=("row", "arena"),
    tables=tables,
    figures=[
        Drawing("success", figures.success, "a heat map of success by row and arena", "Success by row and arena."),
        Drawing(
            "agreement", figures.agreement, "a heat map of agreement by row and arena",
            "Share of the teacher's moments with its commands; in brackets those in which it avoids an obstacle.",
        ),
        Drawing(
            "paths", figures.paths, "paths in the arena large, coloured by the behaviour that speaks",
            "Four paths of each row in the arena large, coloured by who speaks; a cross marks a robot that failed.",
        ),
        Drawing(
            "familiarity", figures.familiarity, "familiarity along one path, coloured by the behaviour that speaks",
            "How well the speaker knows the condition, along the first path in the arena large.",
        ),
    ],
    headline=headline,
    page=page,
    method=METHOD,
    check=check,
    presets=PRESETS,
    objective="evident_sum.large.success_rate",
)  # fmt: skip
