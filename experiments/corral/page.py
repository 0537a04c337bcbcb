"""The page: the table, and pictures that show why it reads as it does. It is drawn from the folder of a run."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

import sim
from experiments.corral import figures, tables, text
from experiments.corral.forgetting import ABOUT
from experiments.corral.map_figure import command_maps
from experiments.corral.timeline_figure import timelines
from experiments.corral.trajectories import as_rollout, representative_episode, timeline
from experiments.kit import Outcome, Page, Row, Study
from experiments.tasks import corral
from sim import render

DRAWN = ("teacher", "default", "bundled", "paper", "paper_best_bins", "hand_written", "random")
"""Controllers whose trajectories are drawn."""
PROGRAMS = ("default", "bundled", "paper", "paper_best_bins", "hand_written")
"""Programs to look into: the first two that the run has."""
REFERENCES = ("teacher", "teacher_wheeled", "random")
"""Controllers whose failures say nothing about learning."""


@dataclass(frozen=True)
class Run:
    """A finished run; any of the controllers may be missing."""

    outcome: Outcome

    @property
    def names(self) -> list[str]:
        """The controllers."""
        return self.outcome.settings.controllers

    @property
    def programs(self) -> list[str]:
        """The programs to look into, at most two."""
        return [name for name in PROGRAMS if name in self.names][:2]

    @functools.cached_property
    def measured(self) -> dict[str, Row]:
        """The numbers of each controller."""
        return tables.by_controller(self.outcome.records)

    @functools.cached_property
    def episodes(self) -> pd.DataFrame:
        """All driven episodes."""
        return tables.episodes_of(self.outcome.records)

    @functools.cached_property
    def episode(self) -> int | None:
        """The held-out start that the animation and the timelines show."""
        names = [name for name in ("teacher", *self.programs) if name in self.names]
        return representative_episode(self.episodes, names)

    def kept(self, kind: str, name: str) -> pd.DataFrame | None:
        """What a controller's cell kept for the page, if it did."""
        path = self.outcome.folder / kind / f"{name}.parquet"
        return pd.read_parquet(path) if path.is_file() else None

    def rollout(self, name: str) -> sim.Rollout | None:
        """The kept starts of a controller."""
        steps, settings = self.kept("trajectories", name), self.outcome.settings
        if steps is None:
            return None
        episodes = self.episodes.loc[self.episodes.controller == name]
        return as_rollout(steps, episodes, corral.arena(settings.arena), settings.seed, settings.seconds)


def page(page: Page, outcome: Outcome, study: Study) -> None:
    """Fill the page with all that the run has something to show for."""
    run = Run(outcome)
    for add in (_what, _table, _success, _corral, _animation, _maps, _timelines, _printed, _where_it_fails, _bodies):
        add(run, page)


def _what(run: Run, page: Page) -> None:
    section = page.section("What was run")
    section.text(text.lead(run.outcome))
    section.table(tables.SETTINGS.show(tables.settings(run.outcome)))


def _table(run: Run, page: Page) -> None:
    section = page.section("The table")
    section.table(tables.MAIN.show(run.outcome.table))
    section.text(tables.AGREEMENT)
    section.table(tables.AGREEMENTS.show(_rows(run, run.names)))


def _success(run: Run, page: Page) -> None:
    page.section("Success").figure(
        "success",
        lambda: figures.success(run.outcome.table),
        "Success rate of each controller with its interval",
        "Dots: share of episodes that succeed. Bars: Wilson's 95 % interval, which is wide where episodes are few.",
        pd.DataFrame(run.outcome.table),
    )


def _corral(run: Run, page: Page) -> None:
    rollouts = {name: run.rollout(name) for name in DRAWN if name in run.names}
    shown = {name: rollout for name, rollout in rollouts.items() if rollout is not None}
    if not shown:
        return
    episodes = sorted(set.intersection(*(set(rollout.episode.tolist()) for rollout in shown.values())))
    page.section("The corral from above").figure(
        "trajectories",
        lambda: figures.trajectories(shown, episodes),
        "Trajectories of the controllers in the corral, seen from above",
        f"The same {len(episodes)} held-out starts for each controller, driven until success or for "
        f"{run.outcome.settings.seconds:g} s. The walls leave one gap, and the lamp stands beyond it. Colours: the "
        "behaviour that the readings call for.",
    )


def _animation(run: Run, page: Page) -> None:
    if not run.outcome.settings.animate or not run.programs or "teacher" not in run.names or run.episode is None:
        return
    names = ["teacher", run.programs[0]]
    rollouts = [rollout for name in names if (rollout := run.rollout(name)) is not None]
    path = render.animate(rollouts, names, run.outcome.folder / "rollout.gif", run.episode)
    page.section("Teacher and learned robot, side by side").picture(
        path.read_bytes(),
        f"Animation of teacher and {names[1]} driving out of the corral",
        text.ANIMATION.format(name=names[1], episode=run.episode),
    )


def _maps(run: Run, page: Page) -> None:
    found = {name: run.kept("maps", name) for name in run.programs if name != "hand_written"}
    maps = {name: frame for name, frame in found.items() if frame is not None}
    if not maps:
        return
    section = page.section("Agreement over sensor space")
    section.text(text.MAPS, *(text.map_summary(name, frame) for name, frame in maps.items()))
    section.figure(
        "command_maps",
        lambda: command_maps(maps),
        "Commands over sensor space of the teacher and the learned programs",
        text.MAPS_CAPTION,
        _joined(maps),
    )


def _timelines(run: Run, page: Page) -> None:
    steps = {name: run.kept("trajectories", name) for name in run.programs}
    if run.episode is None or not steps:
        return
    lines = {name: timeline(frame, run.episode) for name, frame in steps.items() if frame is not None}
    section = page.section("Similarity and familiarity over time")
    section.text(text.TIMELINES, *(text.timeline_summary(name, line) for name, line in lines.items()))
    section.figure(
        "timelines",
        lambda: timelines(lines),
        "Readings, similarity, margin and familiarity over one episode",
        text.TIMELINES_CAPTION,
        _joined(lines),
    )


def _printed(run: Run, page: Page) -> None:
    names = [name for name in ("paper", "paper_best_bins") if name in run.names]
    if not names:
        return
    section = page.section("Why the printed algorithm does what it does")
    learned = {row["controller"]: row for row in tables.learning(run.outcome.records)}
    counts = [learned[name] for name in names]
    section.table(tables.COUNTS.show(counts))
    section.text(*(text.counts_summary(row) for row in counts))
    records = run.outcome.records
    candidates = records.loc[records.kind == "candidate"].to_dict(orient="records")
    if candidates:
        section.table(tables.CANDIDATES.show(candidates))
    found = [run.kept("recall", name) for name in names]
    panels = {int(frame.bins.iloc[0]): frame for frame in found if frame is not None and len(frame)}
    if not panels:
        return
    section.text(text.RECALL)
    section.terms(ABOUT)
    section.figure(
        "recall_by_age",
        lambda: figures.recall_by_age(list(panels.values())),
        "Recall of demonstrated conditions by how many came after them",
        text.RECALL_CAPTION,
        pd.concat(panels.values()),
    )
    for panel in panels.values():
        section.text(*text.recall_summary(panel, run.outcome.config["paper"]["rule"]))


def _where_it_fails(run: Run, page: Page) -> None:
    names = [name for name in run.names if name not in REFERENCES]
    if not names:
        return
    section = page.section("Where it fails")
    rows = [{**row, "differs": 1 - row["heldout_agreement"]} for row in _rows(run, names)]
    section.table(tables.RULES.show(rows))
    section.text(*text.edge_summaries(rows))
    failing = tables.failing(run.episodes, names)
    if not any(row["failed"] for row in failing):
        section.text("No episode of any of these controllers failed.")
        return
    section.table(tables.ENDS.show(failing))
    if mistakes := tables.most_frequent_mistakes(run.outcome.records, names):
        section.table(tables.MISTAKES.show(mistakes))
    section.text(text.failure_summary(failing))


def _bodies(run: Run, page: Page) -> None:
    both = ["teacher", "teacher_wheeled"]
    if not set(both) <= set(run.names):
        return
    success = tables.shared_success(run.episodes, both)
    bodies = {both[0]: run.outcome.settings.body, both[1]: "wheeled"}
    section = page.section("Wheeled and planar body")
    rows = [{"body": bodies[name], **corral.success(len(own), int(own.sum()))} for name, own in success.items()]
    section.table(tables.BODIES.show(rows))
    section.text(text.bodies_summary(run.episodes, bodies))


def _rows(run: Run, names: Sequence[str]) -> list[Row]:
    return [{"controller": name, **run.measured[name]} for name in names]


def _joined(frames: dict[str, pd.DataFrame]) -> pd.DataFrame:
    return pd.concat([frame.assign(controller=name) for name, frame in frames.items()])
