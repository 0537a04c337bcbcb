"""The report of the main job: the table, and pictures that show why it reads as it does."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure
from rich.progress import Progress

import sim
from behaviours import Behaviour, Demonstrations, Policy
from behaviours.storage import write_atomically
from experiments import corral_tables, corral_text, figures
from experiments.agreement import Agreement
from experiments.command_map import SLICES, command_map
from experiments.controllers import TableRow
from experiments.failures import failures, on_the_edge
from experiments.forgetting import ABOUT, Recalled, learners, recalled
from experiments.report import Page, Section
from experiments.results import Results
from experiments.timeline import telling_episode, timeline
from sim import render

SHOWN_DRIVING = ("teacher", "default", "bundled", "paper", "paper_best_bins", "hand_written", "random")
"""Controllers whose trajectories are drawn."""
SHOWN_THINKING = ("default", "bundled", "paper", "paper_best_bins", "hand_written")
"""Programs to look into: the first two that the run has."""
TRAJECTORIES = 12
"""Starts drawn per controller; more hide each other."""


@dataclass(frozen=True)
class CorralRun:
    """What the main job hands over; any of the controllers may be missing.

    Attributes:
        folder: where the run writes.
        results: table, metrics and config.
        controllers, rollouts, agreements: by controller; rollouts are recorded.
        train, heldout: the teacher's samples until it reached the lamp.
    """

    folder: Path
    results: Results
    controllers: Mapping[str, TableRow]
    rollouts: Mapping[str, sim.Rollout]
    agreements: Mapping[str, Agreement]
    train: Demonstrations
    heldout: Demonstrations

    @property
    def minds(self) -> dict[str, Behaviour | Policy]:
        """The programs to look into, at most two."""
        present = [self.controllers[name] for name in SHOWN_THINKING if name in self.controllers]
        return {one.name: one.mind for one in present[:2] if one.mind is not None}

    @functools.cached_property
    def episode(self) -> int | None:
        """The held-out start that the animation and the timelines show."""
        names = [name for name in ("teacher", *self.minds) if name in self.rollouts]
        return telling_episode([self.rollouts[name] for name in names])


def write_report(
    folder: Path,
    results: Results,
    controllers: Mapping[str, TableRow],
    rollouts: Mapping[str, sim.Rollout],
    agreements: Mapping[str, Agreement],
    train: Demonstrations,
    heldout: Demonstrations,
    progress: Progress,
) -> Path:
    """Write `report.html`, its figures under `figures/`, and `rollout.gif` where there is one to show."""
    run = CorralRun(folder, results, controllers, rollouts, agreements, train, heldout)
    (folder / "figures").mkdir(exist_ok=True)
    page = Page("Corral escape: one hypervector drives a robot", corral_text.lead(results.config))
    parts = (_what, _table, _success, _corral, _animation, _maps, _timelines, _printed, _where_it_fails, _bodies)
    for part in progress.track(parts, description="report"):
        part(run, page)
    page.how_to_reproduce(results.config, corral_text.command(folder))
    return page.write(folder / "report.html")


def _what(run: CorralRun, page: Page) -> None:
    section = page.section("What was run")
    section.table(["setting", "value"], corral_tables.settings(run.results.config), words=True)


def _table(run: CorralRun, page: Page) -> None:
    section = page.section("The table")
    columns, rows = corral_tables.main_table(run.results.table)
    section.table(columns, rows, "Green: the best of its column. Orange: less than half of the episodes succeed.")
    section.terms(corral_text.DEFINITIONS)
    columns, rows = corral_tables.agreement_table(run.agreements)
    section.table(columns, rows, corral_text.AGREEMENT_CAPTION)


def _success(run: CorralRun, page: Page) -> None:
    section = page.section("Success")
    _show(
        run,
        section,
        "success",
        lambda: figures.success(run.results.table),
        "Success rate of each controller with its interval",
        "Dots: share of episodes that succeed. Bars: Wilson's 95 % interval, which is wide where episodes are few.",
    )


def _corral(run: CorralRun, page: Page) -> None:
    shown = {name: run.rollouts[name] for name in SHOWN_DRIVING if name in run.rollouts}
    if not shown:
        return
    episodes = sorted(set.intersection(*(set(rollout.episode.tolist()) for rollout in shown.values())))
    section = page.section("The corral from above")
    _show(
        run,
        section,
        "trajectories",
        lambda: figures.trajectories(shown, episodes[:TRAJECTORIES]),
        "Trajectories of the controllers in the corral, seen from above",
        f"The same {len(episodes[:TRAJECTORIES])} held-out starts for each controller, driven until success or for "
        f"{run.results.config['seconds']:g} s. The walls leave one gap, and the lamp stands beyond it. Colours: the "
        "behaviour that the readings call for.",
    )


def _animation(run: CorralRun, page: Page) -> None:
    learned = [name for name in run.minds if name in run.rollouts]
    if not run.results.config["animate"] or not learned or "teacher" not in run.rollouts or run.episode is None:
        return
    names = ["teacher", learned[0]]
    path = render.animate([run.rollouts[name] for name in names], names, run.folder / "rollout.gif", run.episode)
    section = page.section("Teacher and learned robot, side by side")
    section.picture(
        path.read_bytes(),
        f"Animation of teacher and {learned[0]} driving out of the corral",
        f"Teacher and `{learned[0]}` from held-out start {run.episode}. Both begin in the same place with the same "
        "wheel noise in store, and part as soon as one command differs.",
    )


def _maps(run: CorralRun, page: Page) -> None:
    minds = {name: mind for name, mind in run.minds.items() if name != "hand_written"}
    if not minds:
        return
    maps = {name: [command_map(mind, plane, run.heldout) for plane in SLICES] for name, mind in minds.items()}
    section = page.section("Agreement over sensor space")
    section.text(
        "Each small square is one condition: a bin of two sensors, while the third is held. Its colour is the command. "
        "A program answers everywhere, also where nothing was ever demonstrated; dots show where the teacher's "
        "held-out runs have been; a hatched square without a dot was never met in them.",
        *(corral_text.map_summary(name, own) for name, own in maps.items()),
    )
    _show(
        run,
        section,
        "command_maps",
        lambda: figures.command_maps(maps),
        "Commands over sensor space of the teacher and the learned programs",
        "Asked at the middle of each bin; in the last bin at the end of the range, which is what a sensor reads where "
        "it senses nothing. Dots: held-out samples in which the third sensor tells the teacher the same as here. "
        "Dotted line: where the teacher begins to see an obstacle.",
    )


def _timelines(run: CorralRun, page: Page) -> None:
    episode = run.episode
    minds = {name: mind for name, mind in run.minds.items() if name in run.rollouts}
    if not minds or episode is None:
        return
    lines = [timeline(name, mind, run.rollouts[name], episode) for name, mind in minds.items()]
    section = page.section("Similarity and familiarity over time")
    section.text(
        "How sure a program is while it drives. Similarity: cosine of its noisy answer with the result that wins. "
        "Margin: how far the next result lies below. Familiarity: cosine of the condition with the sum of those known; "
        "low where a condition was rarely met or never.",
        *(corral_text.timeline_summary(line) for line in lines),
    )
    _show(
        run,
        section,
        "timelines",
        lambda: figures.timelines(lines),
        "Readings, similarity, margin and familiarity over one episode",
        "Background: the rule that the teacher would follow. Bottom: red marks where the command differs from the "
        "teacher's, blue marks for the behaviour that spoke, where several are combined.",
    )


def _printed(run: CorralRun, page: Page) -> None:
    names = [name for name in ("paper", "paper_best_bins") if name in run.controllers]
    if not names:
        return
    section = page.section("Why the printed algorithm does what it does")
    reports = {name: run.controllers[name].reports[name] for name in names}
    columns, rows = corral_tables.counts_table(reports)
    section.table(columns, rows, corral_text.COUNTS_CAPTION)
    section.text(*(corral_text.counts_summary(name, report) for name, report in reports.items()))
    if "paper_best_bins" in names and run.controllers["paper_best_bins"].tried:
        columns, rows = corral_tables.tried_table(run.controllers["paper_best_bins"].tried)
        section.table(columns, rows, "How the bins of `paper_best_bins` were chosen.")
    panels = recall_panels(run)
    if not panels:
        return
    section.text(corral_text.RECALL_INTRODUCTION)
    section.terms({name: ABOUT[name] for name in panels[0].right})
    _show(
        run,
        section,
        "recall_by_age",
        lambda: figures.forgetting(panels),
        "Recall of demonstrated conditions by how many came after them",
        "Conditions that were shown with one command only, in groups of equal size. Dotted: the recall of a program "
        "that always answers with the most frequent command.",
    )
    for panel in panels:
        section.text(*corral_text.recall_summary(panel, run.results.config["paper"]["rule"]))


def recall_panels(run: CorralRun) -> list[Recalled]:
    """Recall by age at the bins of the run and, where they are others, at those of `paper_best_bins`.

    Left out where every condition was shown with several commands.
    """
    config = run.results.config
    best = run.controllers.get("paper_best_bins")
    bins = [config["encoder"]["bins"], *([best.bins] if best is not None and best.bins is not None else [])]
    panels = [recalled(learners(config, count), run.train) for count in dict.fromkeys(bins)]
    return [panel for panel in panels if len(panel.age)]


def _where_it_fails(run: CorralRun, page: Page) -> None:
    names = [name for name in run.controllers if name not in ("teacher", "teacher_wheeled", "random")]
    if not names:
        return
    section = page.section("Where it fails")
    minds = {name: run.controllers[name].mind for name in names}
    edges = {name: None if mind is None else on_the_edge(mind, run.train, run.heldout) for name, mind in minds.items()}
    columns, rows = corral_tables.rules_table({name: run.agreements[name] for name in names}, edges)
    section.table(columns, rows, corral_text.RULES_CAPTION)
    section.text(*corral_text.edge_summaries(run.agreements, edges))
    failed = {name: failures(run.rollouts[name]) for name in names}
    if not any(len(one.episodes) for one in failed.values()):
        section.text("No episode of any of these controllers failed.")
        return
    columns, rows = corral_tables.ends_table(failed, run.rollouts)
    section.table(columns, rows, "Failing episodes, and where the robot was when the time was up.")
    columns, rows = corral_tables.mistakes_table(failed)
    if rows:
        section.table(columns, rows, corral_text.MISTAKES_CAPTION, words=True)
    section.text(corral_text.failure_summary(failed))


def _bodies(run: CorralRun, page: Page) -> None:
    if not {"teacher", "teacher_wheeled"} <= set(run.rollouts):
        return
    section = page.section("Wheeled and planar body")
    planar, wheeled = run.rollouts["teacher"], run.rollouts["teacher_wheeled"]
    columns, rows = corral_tables.bodies_table([planar, wheeled])
    section.table(columns, rows)
    section.text(corral_text.bodies_summary(planar, wheeled))


def _show(run: CorralRun, section: Section, name: str, draw: Callable[[], Figure], alt: str, caption: str) -> None:
    """Draw a figure, keep it as a file, and put it on the page."""
    content = figures.png(draw())
    write_atomically(run.folder / "figures" / f"{name}.png", content)
    section.picture(content, alt, caption)
