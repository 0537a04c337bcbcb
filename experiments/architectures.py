"""Which architecture drives the robot best, and with which encoder?

Each architecture learns the corral escape with every encoder that it supports, from the same demonstrations and by the
same rule, and drives from the same starts.

    torchvsa architectures
    torchvsa architectures architectures=[MAP-C,VTB] dim=1024 starts=100
    torchvsa architectures architectures=[HRR,FHRR] encoders=[fractional_power] demonstrations=5 rule.epochs=20
"""

import itertools
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import torch
from matplotlib.figure import Figure

import sim
import torchvsa
from behaviours import Space
from behaviours.learning import ConvergenceWarning
from experiments.kit import Cell, Column, Drawing, Outcome, Part, Row, Study, Table, part, parts, setting
from experiments.kit.intervals import proportion
from experiments.tasks import corral, in_bullet
from experiments.tasks.agreement import compare
from experiments.tasks.timing import query_seconds
from torchvsa import ARCHITECTURES, architecture_near
from torchvsa.encoders import VALUE_ENCODERS, Encoder

RECORDS = ["product", "sum", "subset_product"]
BOTH = ["threshold_features", "random_fourier"]
"""Encoders of all sensors at once."""


@dataclass
class Architectures(in_bullet.InBullet):
    """The settings of this study."""

    architectures: list[str] = setting(
        [], "what is compared; none named: all that are known", choices=lambda: ARCHITECTURES, distinct=True, empty=True
    )
    dim: int = setting(
        4000, "elements of a hypervector; an architecture takes the nearest number it allows", low=4, high=1_000_000
    )
    encoders: list[str] = setting(
        ["level", "lookup", "thermometer"], "codes of one reading, in each record",
        choices=lambda: VALUE_ENCODERS, distinct=True,
    )  # fmt: skip
    records: list[str] = setting(
        [*RECORDS, *BOTH], "what makes a condition of all readings", choices=[*RECORDS, *BOTH], distinct=True
    )
    bins: int = setting(32, "bins of each sensor; level codes span a quarter of them", low=4, high=1_000_000)
    protection: Part = part("protection", "none", "what is done to a condition before it is bound")
    rule: Part = part("rule", "error_driven", "how a program is learned")
    demonstrations: int = corral.episodes(20, "episodes of the teacher to learn from")
    starts: int = corral.episodes(200, "held-out starts")
    repeats: int = setting(2, "draws of the codebooks", low=1)
    bullet_encoders: list[str] = setting(
        ["product of level"], "those of the encoders with which robots drive in the physics engine, too, of every "
        "architecture that supports them and with each draw", choices=lambda: every_condition(), distinct=True,
        empty=True,
    )  # fmt: skip
    bullet_starts: int = corral.episodes(50, "their first starts, driven in the physics engine, too; 0: none", low=0)
    wheeled_starts: int = corral.episodes(20, "the same on the wheeled body", low=0)


def compared(settings: Architectures) -> list[str]:
    """The architectures that are compared."""
    return settings.architectures or list(ARCHITECTURES)


def conditions(settings: Architectures) -> list[str]:
    """The names of all ways to encode a condition."""
    return _named(settings.records, settings.encoders)


def every_condition() -> list[str]:
    """The same of any settings."""
    return _named([*RECORDS, *BOTH], list(VALUE_ENCODERS))


def _named(records: list[str], codes: list[str]) -> list[str]:
    joined = [f"{record} of {code}" for record in records if record in RECORDS for code in codes]
    return joined + [record for record in records if record in BOTH]


def plan(settings: Architectures, architecture: str, encoder: str) -> Encoder:
    """An encoder without codebooks. Raises `ValueError` if the architecture or the rule does not support it."""
    record, _, code = encoder.partition(" of ")
    # MAP in its smallest exact type, all others in their own.
    vsa = architecture_near(architecture, settings.dim, torch.int8 if architecture.startswith("MAP") else None)
    values: dict[str, Any] = {"name": code} | ({} if code == "fractional_power" else {"bins": settings.bins})
    if code == "level":
        values["span"] = settings.bins // 4
    made = parts.conditions(vsa, len(corral.schema().sensors), values, {"name": record})
    torchvsa.protection(settings.protection, vsa)
    rule = parts.rule(settings.rule)
    if not rule.supports(vsa):
        raise ValueError(f"the rule {rule.name} cannot train programs of {architecture}")
    return made


def refusal(settings: Architectures, architecture: str, encoder: str) -> str:
    """Why the architecture cannot do it; empty if it can."""
    try:
        plan(settings, architecture, encoder)
    except ValueError as error:
        return str(error)
    return ""


def cells(settings: Architectures) -> list[Cell]:
    """A cell for each architecture, encoder that it supports, and draw."""
    return [
        {"architecture": name, "encoder": encoder, "repeat": repeat}
        for name, encoder in itertools.product(compared(settings), conditions(settings))
        if not refusal(settings, name, encoder)
        for repeat in range(settings.repeats)
    ]


def check(settings: Architectures) -> None:
    """Raise unless there is something to compare, and a robot that can drive."""
    in_bullet.check(settings, bool(set(conditions(settings)) & set(settings.bullet_encoders)))
    if not cells(settings):
        raise ValueError(
            f"records={settings.records}: no architecture supports them; "
            + refusal(settings, compared(settings)[0], conditions(settings)[0])
        )


def prepare(settings: Architectures, folder: Path, progress: Any) -> dict[str, Any]:
    """Let the teacher demonstrate, and drive the held-out starts."""
    first, teacher = corral.FIRST_DEMONSTRATION, sim.Teacher()
    shown = range(first, first + settings.demonstrations)
    train = corral.drive_together(settings, "teacher demonstrates", teacher, shown, progress)
    examined = corral.drive_together(settings, "teacher, held out", teacher, range(settings.starts), progress)
    return {"settings": settings, "train": corral.moving(train), "held_out": corral.moving(examined)}


def measure(material: dict[str, Any], cell: Cell) -> Row:
    """Learn, ask, drive."""
    settings, train, held_out = material["settings"], material["train"], material["held_out"]
    encoder = plan(settings, cell["architecture"], cell["encoder"])
    protection = torchvsa.protection(settings.protection, encoder.vsa)
    own = Space(corral.schema(), encoder, protection=protection, seed=settings.seed + cell["repeat"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # the row tells what is still wrong
        behaviour = parts.rule(settings.rule).fit(own, train)
    found = compare(behaviour, own, train, held_out, own)
    rollout = corral.drive(settings, behaviour, range(settings.starts))
    in_both = cell["encoder"] in settings.bullet_encoders
    return {
        "dim": own.vsa.dim,
        "success": int(rollout.success.sum()),
        "agreement": found.heldout,
        "train_agreement": found.train,
        "pairs": behaviour.report.pairs,
        "wrong": behaviour.report.wrong,
        "query_us": 1e6 * query_seconds(behaviour.freeze(), held_out.sensors.numpy()),
        "bytes": behaviour.program.nbytes,
        **(in_bullet.counted(in_bullet.effects(settings, behaviour, rollout)) if in_both else {}),
    }


def summarise(settings: Architectures, records: pd.DataFrame) -> list[Row]:
    """A row for each architecture and encoder: the mean over the draws, success of all starts together."""
    rows = []
    for name, encoder in itertools.product(compared(settings), conditions(settings)):
        own = records.loc[(records.architecture == name) & (records.encoder == encoder)]
        if own.empty:
            continue
        means = own[["dim", "agreement", "train_agreement", "pairs", "wrong", "bytes"]].mean().to_dict()
        reached = proportion("success", int(own.success.sum()), settings.starts * len(own))
        row = {"architecture": name, "encoder": encoder, **means, **reached, **in_bullet.differences(own)}
        rows.append({**row, "worst": own.success.min() / settings.starts, "query_us": own.query_us.median()})
    return rows


def headline(outcome: Outcome) -> str:
    """Which combinations drive well."""
    well = [row for row in outcome.table if row["worst"] >= GOOD]
    names = {row["architecture"] for row in outcome.table}
    missing = sorted(names - {row["architecture"] for row in well})
    least = f"; none of {', '.join(missing)}" if missing else ", of every architecture at least one"
    return (
        f"{len(well)} of {len(outcome.table)} combinations of architecture and encoder reach the lamp from at least "
        f"{100 * GOOD:.0f} % of the starts with every draw of the codebooks{least}."
    )


def maps(outcome: Outcome) -> Figure:
    """Success and agreement of each architecture with each encoder; empty where it is not supported."""
    import seaborn

    rows = compared(outcome.settings)
    columns = [name for name in conditions(outcome.settings) if any(row["encoder"] == name for row in outcome.table)]
    frame = pd.DataFrame(outcome.table)
    figure = Figure(figsize=(2 + 0.62 * len(columns), 3.4 + 0.72 * len(rows)), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    for axes, (measured, title) in zip(
        panels, {"success_rate": "success", "agreement": "agreement"}.items(), strict=True
    ):
        values = frame.pivot(index="architecture", columns="encoder", values=measured).reindex(rows)[columns]
        texts = values.map(lambda value: "" if pd.isna(value) else f"{value:.2f}".replace("0.", "."))
        seaborn.heatmap(
            values, vmin=0, vmax=1, annot=texts, fmt="", cmap="viridis", ax=axes, cbar=False, annot_kws={"size": 7.5},
            linewidths=0.5,
        )  # fmt: skip
        axes.set(xlabel="", ylabel="", title=title)
        axes.tick_params(axis="y", rotation=0)
    return figure


def tables(outcome: Outcome) -> list[Table]:
    """What was measured; the same in the physics engine; and what the algebra refuses."""
    refused = [
        {"architecture": name, "encoder": encoder, "why": why}
        for name, encoder in itertools.product(compared(outcome.settings), conditions(outcome.settings))
        if (why := refusal(outcome.settings, name, encoder))
    ]
    about = "Those with an encoder of `bullet_encoders`, from their first starts with each draw of the codebooks."
    keys = [Column("architecture"), Column("encoder")]
    shown = [TABLE.show(outcome.table), *in_bullet.tables(keys, outcome.table, about)]
    return [*shown, REFUSED.show(refused)] if refused else shown


GOOD = 0.95
"""Success from which a combination is said to drive well."""
TABLE = Table(
    "Architectures and encoders in the corral",
    [
        Column("architecture"),
        Column("encoder", about="record of value codes, or an encoder of all sensors at once"),
        Column("dim", "d", ",.0f"),
        Column("success_rate", "success", ".3f", interval=("success_low", "success_high"), about="share of held-out "
               "starts from which the robot reaches the lamp and stays, over all draws (Wilson)"),
        Column("worst", "worst draw", ".3f", about="success of the worst draw of the codebooks"),
        Column("agreement", format=".3f", about="share of held-out samples in which it does what the teacher does"),
        Column("train_agreement", "on shown", ".3f", about="the same on demonstrated samples that nothing contradicts"),
        Column("pairs", format=",.0f", about="pairs of condition and result that were learned"),
        Column("wrong", format=",.0f", about="pairs that the program does not recall with its margin after training"),
        Column("query_us", "µs", ".0f", about="median time of one answer to one robot by the frozen behaviour"),
        Column("bytes", format=",.0f", about="of the program, one hypervector as a raw accumulator"),
    ],
)  # fmt: skip
REFUSED = Table("What is refused, and why", [Column("architecture"), Column("encoder"), Column("why")])
METHOD = """
All architectures learn from the same runs of the teacher by the same rule, and drive from the same starts, each with
its own codebooks. Whatever an encoder needs and the architecture lacks is refused before anything is driven. With the
encoders `bullet_encoders` robots drive in the physics engine, too, from the first `bullet_starts` and `wheeled_starts`
starts.
"""
FIGURE = Drawing("architectures", maps, "success and agreement of each architecture with each encoder")
QUICK = {"dim": 500, "demonstrations": 10, "starts": 20, "repeats": 1, "encoders": ["level"], "records": ["product"],
         "bullet_starts": 0, "wheeled_starts": 0}  # fmt: skip

study = Study(
    name="architectures",
    about="Which architecture drives the robot best, and with which encoder?",
    settings=Architectures,
    check=check,
    prepare=prepare,
    cells=cells,
    measure=measure,
    summarise=summarise,
    keys=("architecture", "encoder"),
    tables=tables,
    figures=[FIGURE],
    headline=headline,
    method=METHOD,
    presets={"quick": QUICK},
)
