"""The page of `torchvsa learn`: how good the behaviour is, where it errs, and what to demonstrate next."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from behaviours import Actuator, Sensor
from behaviours.commands.learn import Learned, score_rows
from behaviours.commands.validate import RIVALS, SMOOTH
from behaviours.parts import span
from experiments.kit.columns import Column, Table
from experiments.kit.figures import legend_below, lines
from experiments.kit.page import Page, Section
from experiments.own_robot.regions import REGIONS, contradictions, next_demonstrations, regions, runs
from experiments.own_robot.tables import error_format, score_table, with_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PANEL = 2.6, 2.1
"""The size of a panel in inches."""
_MOST_PANELS = 24


def write_page(learned: Learned, path: Path) -> Path:
    """Write the page as one HTML file that needs nothing else."""
    page = Page(f"{learned.options.name}: a behaviour from {learned.options.log.name}", headline=headline(learned))
    about = len(learned.shown), len(learned.schema.sensors), len(learned.schema.actuators)
    page.lead = (
        f"{about[0]:,} rows of {about[1]} sensors and {about[2]} actuators became one hypervector of "
        f"{learned.options.dim:,} elements; its commands are {'smooth' if learned.kind == SMOOTH else 'levels'}. Each "
        f"figure below is about rows of {_held(learned)} that were not shown."
    )
    _scores(page.section("Scores"), learned)
    _next(page.section("What to demonstrate next"), learned)
    _regions(page.section("Where it errs"), learned)
    _unfamiliar(page.section("What is unfamiliar"), learned)
    _contradictions(page.section("What contradicts"), learned)
    _sizes(page.section("Dimensions and bins"), learned)
    _columns(page.section("Sensors and actuators"), learned)
    page.draw()
    return page.write(path)


def headline(learned: Learned) -> str:
    """The errors of the behaviour beside those of the best rival."""
    rows = {row["model"]: row for row in score_rows(learned)}
    parts = []
    for actuator in learned.schema.actuators:
        rival = min(RIVALS, key=lambda name: rows[name][actuator.name])
        mine, theirs = rows[learned.kind][actuator.name], rows[rival][actuator.name]
        form = error_format(actuator)
        parts.append(f"{with_unit(actuator)} is off by {mine:{form}} on average ({rival}: {theirs:{form}})")
    return f"In {_held(learned)} that were not shown, {'; '.join(parts)}."


def _held(learned: Learned) -> str:
    return "runs" if learned.by else "stretches of time"


def _scores(section: Section, learned: Learned) -> None:
    section.table(score_table(learned))
    section.table(
        Table(
            "By run" if learned.by else "By stretch of time",
            [
                Column("run", _held(learned).removesuffix("s") if learned.by else "stretch"),
                Column("rows", format=","),
                *(
                    Column(f"{model} {actuator.name}", f"{actuator.name}: {model}", error_format(actuator))
                    for actuator in learned.schema.actuators
                    for model in (learned.kind, *RIVALS)
                ),
            ],
            "Mean absolute error in each of them, while the model was learned from the others.",
        ).show(runs(learned))
    )


def _next(section: Section, learned: Learned) -> None:
    found = next_demonstrations(learned)
    if not found:
        section.text("Nothing stands out: no region has an error well above the mean, and none is unfamiliar.")
        return
    section.text(
        "Readings for which more demonstrations would help most, the most promising first: those with a large share of "
        "the whole error, and those that resemble nothing that was shown in other runs."
    )
    columns = [
        Column("where"),
        Column("rows", format=","),
        Column("off", "error, times the mean", ".1f"),
        Column("share", "share of the whole error", ".0%"),
        Column("unfamiliar", "unfamiliar", ".0%"),
    ]
    section.table(Table("More demonstrations", columns).show(found))


def _regions(section: Section, learned: Learned) -> None:
    frame = regions(learned)
    section.text(
        f"Each panel divides the readings of a sensor into at most {REGIONS} regions with equally many rows. Where the "
        "line is above that of the nearest neighbours, the behaviour errs more than they do."
    )
    names = [sensor.name for sensor in learned.schema.sensors]
    actuators = [actuator.name for actuator in learned.schema.actuators]
    shown = max(1, _MOST_PANELS // len(actuators))
    if len(names) > shown:
        largest = (
            frame.loc[frame["model"] == learned.kind].groupby("sensor")["share"].max().sort_values(ascending=False)
        )
        names = [name for name in names if name in largest.index[:shown]]
        section.text(f"Only the {shown} sensors with the largest differences are shown; the CSV file has all of them.")
    part = frame.loc[frame["sensor"].isin(names)]
    section.figure(
        "regions",
        functools.partial(_draw_regions, part, names, actuators),
        "The mean absolute error of each actuator by the reading of each sensor",
        "Mean absolute error of each actuator (rows of panels) by reading (columns).",
        frame,
    )


def _draw_regions(frame: pd.DataFrame, names: list[str], actuators: list[str]) -> Figure:
    from matplotlib.figure import Figure

    width, height = _PANEL
    figure = Figure(figsize=(max(1 + width * len(names), 5.4), 0.8 + height * len(actuators)), layout="constrained")
    grid = figure.subplots(len(actuators), len(names), squeeze=False, sharey="row", sharex="col")
    for row, actuator in enumerate(actuators):
        for place, sensor in enumerate(names):
            axes = grid[row, place]
            here = frame.loc[(frame["sensor"] == sensor) & (frame["actuator"] == actuator)]
            lines(axes, here, "reading", "error", "model", order=[frame["model"].iloc[0], *RIVALS[:2]])
            labels = here.drop_duplicates("reading")
            if (labels["label"] != "").any():
                axes.set_xticks(labels["reading"], labels["label"], rotation=30, ha="right")
            axes.set(xlabel=sensor if row == len(actuators) - 1 else "", ylabel=actuator if place == 0 else "")
    for axes in grid.ravel():
        # The largest error of a row of panels decides, so after all of them are drawn.
        axes.set_ylim(bottom=0)
    legend_below(figure, columns=3)
    return figure


def _unfamiliar(section: Section, learned: Learned) -> None:
    validation = learned.validation
    strange, errors = validation.unfamiliar, validation.errors(learned.kind)
    section.text(
        f"{strange.mean():.1%} of the rows resemble what was shown in the other {_held(learned)} less than nearly all "
        "of that resembles itself. A robot can ask for this before it acts: `Recall.familiarity`."
    )
    if not strange.any() or strange.all():
        return
    rows = [
        {"rows": name, "count": int(which.sum())}
        | dict(zip((a.name for a in learned.schema.actuators), errors[which].mean(0).tolist(), strict=True))
        for name, which in (("familiar", ~strange), ("unfamiliar", strange))
    ]
    columns = [Column("rows"), Column("count", "rows", ",")]
    columns += [Column(a.name, f"{with_unit(a)}: error", error_format(a)) for a in learned.schema.actuators]
    section.table(Table("Errors where readings are familiar, and where not", columns).show(rows))


def _contradictions(section: Section, learned: Learned) -> None:
    count, found = contradictions(learned)
    section.text(
        f"{learned.report.contradicting:,} of {learned.report.samples:,} rows have exactly the condition of another "
        f"row and another command. In a coarser view, of {REGIONS} regions per sensor, the commands of {count:.0%} of "
        "the rows differ from those of their neighbours by more than a quarter of the range: something that no sensor "
        "tells, such as what the robot is about to do, decides there."
    )
    if found:
        columns = [Column("where"), Column("rows", format=","), Column("commands")]
        section.table(Table("Where commands contradict most", columns, words=False).show(found))


def _sizes(section: Section, learned: Learned) -> None:
    ranges = {actuator.name: actuator.high - actuator.low for actuator in learned.schema.actuators}
    frame = pd.DataFrame(learned.by_size)
    section.text("More dimensions hold more; more bins tell closer readings apart, and need more rows.")
    columns = [Column("dim", "d", ","), Column("bins", "bins per sensor", ",")]
    columns += [Column(a.name, f"{with_unit(a)}: error", error_format(a), best="min") for a in learned.schema.actuators]
    section.table(Table("Error by d and bins", columns, "In the first fold.").show(learned.by_size))
    section.figure(
        "sizes",
        functools.partial(_draw_sizes, frame, ranges),
        "The error of each actuator by the number of dimensions, and by bins",
        "Error as a share of the range, by dimensions (with 256 bins) and by bins (with 4,000 dimensions).",
        frame,
    )


def _draw_sizes(frame: pd.DataFrame, ranges: dict[str, float]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 2.8), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    sides = ("dim", frame.loc[frame["bins"] == 256]), ("bins", frame.loc[frame["dim"] == 4000])
    for place, (x, part) in zip(axes, sides, strict=True):
        part = part.sort_values(x)
        tall = part.melt([x], list(ranges), "actuator", "error")
        tall["error"] /= tall["actuator"].map(ranges)
        lines(place, tall, x, "error", "actuator", order=list(ranges))
        place.set(xscale="log", xlabel={"dim": "dimensions", "bins": "bins per sensor"}[x], ylabel="error / range")
        place.set_xticks(part[x], [f"{value:,}" for value in part[x]], minor=False)
        place.minorticks_off()
    axes[0].set_ylim(bottom=0)
    legend_below(figure, axes[0])
    return figure


def _columns(section: Section, learned: Learned) -> None:
    parts = [*learned.schema.sensors, *learned.schema.actuators]
    rows = [{"name": part.name, "what": type(part).__name__.lower(), "is": described(part)} for part in parts]
    columns = [Column("name"), Column("what"), Column("is", "range")]
    section.table(Table("Sensors and actuators", columns, words=True).show(rows))
    if learned.notes:
        section.code("\n".join(learned.notes), "How the columns of the log were understood.")


def described(part: Sensor | Actuator) -> str:
    """The range of a sensor or an actuator in words."""
    if isinstance(part, Sensor) and part.values:
        return ", ".join(map(str, part.values))
    return f"{span(part)} in {part.levels} levels" if isinstance(part, Actuator) else span(part)
