"""The report of the generalisation study: tables and figures of its parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from behaviours.storage import write_atomically
from experiments.figures import png
from experiments.generalisation_figures import PANELS, panels
from experiments.report import Cell, Page
from experiments.results import Results, Row


@dataclass(frozen=True)
class Shown:
    """A table as text: for the terminal and for the page."""

    title: str
    columns: list[str]
    rows: list[list[str]]
    caption: str = ""

    def for_terminal(self) -> Table:
        """The table in rich's words."""
        table = Table(title=self.title)
        for place, column in enumerate(self.columns):
            table.add_column(column, justify="right" if place else "left", no_wrap=True)
        for row in self.rows:
            table.add_row(*row)
        return table


def tables(table: Sequence[Row]) -> list[Shown]:
    """The tables of all parts that were run; of the corral's combinations, those that drove."""
    makers = {
        "corral": _corral,
        "wall_following": _wall_following,
        "smooth": _smooth,
        "fit_times": _wall_following,
    }
    shown = []
    for part in dict.fromkeys(row["part"] for row in table):
        shown += makers[part]([row for row in table if row["part"] == part])
    return shown


def _corral(rows: Sequence[Row]) -> list[Shown]:
    counts = sorted({row["demonstrations"] for row in rows} - {None})
    shown = []
    for figure, title in (("heldout", "agreement"), ("unseen", "agreement, conditions never met")):
        lines = {}
        for row in rows:
            if row["arena"] == "default" and row[figure] is not None and row["demonstrations"] is not None:
                low, high = row[f"{figure}_min"], row[f"{figure}_max"]
                lines.setdefault(row["learner"], {})[row["demonstrations"]] = (
                    f"{row[figure]:.3f} [{low:.2f}, {high:.2f}]"
                )
        if lines:
            cells = [[name, *(line.get(count, "-") for count in counts)] for name, line in lines.items()]
            shown.append(
                Shown(
                    f"Corral: {title}, by demonstrations",
                    ["learner", *map(str, counts)],
                    cells,
                    "Median over the draws of the demonstrations, with lowest and highest, in held-out runs.",
                )
            )
    lines = {}
    for row in rows:
        if row["success_rate"] is not None:
            text = f"{row['success_rate']:.2f} [{row['success_low']:.2f}, {row['success_high']:.2f}]"
            lines.setdefault((row["learner"], row["arena"]), {})[row["demonstrations"]] = text
    teacher = {arena: line[None] for (name, arena), line in lines.items() if name == "teacher"}
    cells = [
        [f"{name}, {arena}", *(line.get(count, "-") for count in counts), teacher[arena]]
        for (name, arena), line in lines.items()
        if name != "teacher"
    ]
    caption = (
        "Share of unseen starts from which the robot reaches the lamp and stays, all draws together, with Wilson's "
    )
    shown.append(
        Shown(
            "Corral: success, by demonstrations",
            ["learner, arena", *map(str, counts), "teacher"],
            cells,
            caption + "95 % interval.",
        )
    )
    return shown


def _wall_following(rows: Sequence[Row]) -> list[Shown]:
    keys = list(dict.fromkeys((row["sensors"], row["split"]) for row in rows))
    headings = [f"{sensors}, {split}" for sensors, split in keys]
    by = {(row["model"], row["sensors"], row["split"]): row for row in rows}
    models = list(dict.fromkeys(row["model"] for row in rows))
    shown = []
    for figure, title, form in (("accuracy", "accuracy", ".4f"), ("fit_s", "seconds to fit all folds", ".1f")):
        cells = [[m, *(format(by[m, *k][figure], form) if (m, *k) in by else "-" for k in keys)] for m in models]
        caption = "Mean over the folds." if figure == "accuracy" else "The sum over the folds."
        shown.append(Shown(f"Wall following: {title}", ["model", *headings], cells, caption))
    return shown


def _smooth(rows: Sequence[Row]) -> list[Shown]:
    cells = []
    for row in rows:
        name = row["model"] if row["levels"] is None else f"{row['levels']} levels"
        success = "-" if row["success_rate"] is None else f"{row['success_rate']:.2f}"
        figures = (_number(row[figure]) for figure in ("rmse", "relative", "rounding_rmse"))
        cells.append([f"{row['task']}: {name}", str(row["dim"] or "-"), *figures, success])
    caption = (
        "Root mean square error against the demonstrated commands, which lie in [-1, 1]; as a share of the error of "
    )
    caption += "always commanding the mean; and what rounding to the levels alone costs."
    columns = ["teacher: model", "d", "error", "relative", "rounding alone", "success"]
    return [Shown("Smooth commands", columns, cells, caption)]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"


ABOUT = {
    "corral": "Every learner sees the same demonstrations, the larger ones containing the smaller. Agreement: share of "
    "held-out samples, before the lamp was reached, in which it commands what the teacher does. A condition was never "
    "met if its bins were in no demonstration. Learners are named encoder/protection/record/rule; all combinations are "
    "asked, and those drive that differ from the default in one part at most.",
    "wall_following": "A real robot's distances and the command that it gave. Stratified folds put neighbours in time "
    "on both sides; blocks hold back whole stretches of it. Models that compare or weigh features see them in units of "
    "the training rows' standard deviation. One thread each, while another process works.",
    "smooth": "Commands of two teachers without steps: `corral_commands`, which drives in the corral, and "
    "`wall_commands`, which answers the real robot's distances in front and to the left and is to be learned from the "
    "24 raw ones, over blocks in time. The interpolating program is a `BehaviourRegressor`; the levels are the same "
    "codes with a clean-up among the commands that were shown.",
    "fit_times": "Both models learn the same stratified folds in turns, in one process and with nothing else at work.",
}
TITLES = {
    "corral": "Few demonstrations, unseen arenas",
    "wall_following": "A real robot that follows a wall",
    "smooth": "Smooth commands",
    "fit_times": "Time to learn",
}


def write_report(folder: Path, results: Results, notes: Sequence[str] = ()) -> Path:
    """Write `report.html` and its figures under `figures/`."""
    (folder / "figures").mkdir(exist_ok=True)
    page = Page("Generalisation", "What one hypervector does where it was not shown.")
    for part in dict.fromkeys(row["part"] for row in results.table):
        rows = [row for row in results.table if row["part"] == part]
        section = page.section(TITLES[part])
        section.text(ABOUT[part], *(note for note in notes if part == "wall_following"))
        if part in PANELS:
            content = png(panels(rows, [part]))
            write_atomically(folder / "figures" / f"{part}.png", content)
            section.picture(content, f"{TITLES[part]}: the figures of the tables below")
        for shown in tables(rows):
            section.table(shown.columns, _marked(shown), f"{shown.title}. {shown.caption}")
    drawn = [part for part in PANELS if any(row["part"] == part for row in results.table)]
    if drawn:
        write_atomically(folder / "figures" / "generalisation.png", png(panels(results.table, drawn), dpi=100))
    page.how_to_reproduce(results.config)
    return page.write(folder / "report.html")


def _marked(shown: Shown) -> list[list[str | Cell]]:
    """The rows of a table of accuracies with the best of each column marked; others as they are."""
    if not shown.title.endswith(": accuracy"):
        return [list(row) for row in shown.rows]
    best = [max(column) for column in zip(*(row[1:] for row in shown.rows), strict=True)]
    return [
        [row[0], *(Cell(cell, "best" if cell == top else "") for cell, top in zip(row[1:], best, strict=True))]
        for row in shown.rows
    ]
