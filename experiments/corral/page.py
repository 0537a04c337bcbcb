"""The page: the table, and pictures that show why it reads as it does. It is drawn from the folder of a run."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import pandas as pd

import sim
from experiments.corral import figures, tables
from experiments.corral.forgetting import ABOUT, CLIPPED, by_age
from experiments.corral.trajectories import as_rollout, driven_episodes, representative_episode
from experiments.kit import Outcome, Page
from sim import render

DRAWN = ("teacher", "default", "bundled", "paper", "paper_best_bins", "hand_written", "random")
"""Controllers whose trajectories are drawn."""
PROGRAMS = ("default", "bundled", "paper", "paper_best_bins", "hand_written")
"""Programs to look into: the first two that the run has."""
REFERENCES = ("teacher", "teacher_bullet", "teacher_wheeled", "random")
"""Controllers whose failures say nothing about learning."""


@dataclass(frozen=True)
class Run:
    """A finished run; any of the controllers may be missing."""

    outcome: Outcome

    def those(self, names: Sequence[str]) -> list[str]:
        """Those of the names that are controllers of the run."""
        return [name for name in names if name in self.outcome.settings.controllers]

    @property
    def programs(self) -> list[str]:
        """The programs to look into, at most two."""
        return self.those(PROGRAMS)[:2]

    @functools.cached_property
    def episodes(self) -> pd.DataFrame:
        """All driven episodes."""
        return driven_episodes(self.outcome.records)

    @functools.cached_property
    def episode(self) -> int | None:
        """The held-out start that the animation and the timelines show."""
        return representative_episode(self.episodes, [*self.those(["teacher"]), *self.programs])

    def kept(self, kind: str, names: Sequence[str]) -> dict[str, pd.DataFrame]:
        """What the cells of some controllers kept for the page, of those that did."""
        paths = {name: self.outcome.folder / kind / f"{name}.parquet" for name in self.those(names)}
        return {name: pd.read_parquet(path) for name, path in paths.items() if path.is_file()}

    def rollouts(self, names: Sequence[str]) -> dict[str, sim.Rollout]:
        """The kept starts of some controllers."""
        return {
            name: as_rollout(steps, self.episodes.loc[self.episodes.controller == name], self.outcome.settings)
            for name, steps in self.kept("trajectories", names).items()
        }


def fill(page: Page, outcome: Outcome) -> None:
    """Fill the page with all that the run has something to show for."""
    run = Run(outcome)
    for add in (_table, _corral, _maps, _timelines, _printed, _failures):
        add(run, page)


def _table(run: Run, page: Page) -> None:
    outcome, config = run.outcome, run.outcome.config
    section = page.section("The table")
    section.text(
        "A simulated robot leaves a corral and finds a lamp. Each controller learns from runs of a teacher with five "
        "rules, or is a reference point, and then drives by itself from starts that it was never shown. `default` is "
        f"one hypervector: `{config['encoder']['name']}` codes of the readings, joined by `{config['record']['name']}` "
        f"and learned by `{config['rule']['name']}`. All settings are at the end of the page."
    )
    section.table(tables.MAIN.show(outcome.table))
    section.figure(
        "success",
        lambda: figures.success(outcome.table),
        "Success rate of each controller with its interval",
        "Dots: share of episodes that succeed. Bars: Wilson's 95 % interval, which is wide where episodes are few.",
        pd.DataFrame(outcome.table),
    )
    if any(row["minus_original"] is not None for row in outcome.table):
        section.text(
            f"Rows that end in `_bullet` and `_wheeled` repeat others in the physics engine: with the same body, and "
            f"with wheels on a floor. All others are driven by the engine `{config['engine']}`."
        )
    section.table(tables.AGREEMENT.show(outcome.table))


def _corral(run: Run, page: Page) -> None:
    shown = run.rollouts(DRAWN)
    if not shown:
        return
    episodes = sorted(set.intersection(*(set(rollout.episode.tolist()) for rollout in shown.values())))
    section = page.section("The corral from above")
    section.figure(
        "trajectories",
        lambda: figures.trajectories(shown, episodes),
        "Trajectories of the controllers in the corral, seen from above",
        f"The same {len(episodes)} held-out starts for each controller, driven until success or for "
        f"{run.outcome.settings.seconds:g} s. Colours: the behaviour that the readings call for.",
    )
    names = [name for name in ("teacher", *run.programs[:1]) if name in shown]
    if run.outcome.settings.animate and len(names) == 2 and run.episode is not None:
        both = [shown[name] for name in names]
        section.animation(
            "rollout",
            lambda path: render.animate(both, names, path, run.episode),
            f"Animation of teacher and {names[1]} driving out of the corral",
            f"Teacher and `{names[1]}` from held-out start {run.episode}. Both begin in the same place with the same "
            "wheel noise in store, and part as soon as one command differs.",
        )


def _maps(run: Run, page: Page) -> None:
    maps = run.kept("maps", [name for name in run.programs if name != "hand_written"])
    if not maps:
        return
    page.section("Agreement over sensor space").figure(
        "command_maps",
        lambda: figures.command_maps(maps),
        "Commands over sensor space of the teacher and the learned programs",
        "Each small square is one condition: a bin of two sensors, while the third is held. Its colour is the command. "
        "A program answers everywhere, also where nothing was ever demonstrated; dots: held-out samples in which the "
        "third sensor tells the teacher the same as here. A hatched square without a dot was never met in them. Asked "
        "at the middle of each bin; in the last bin at the end of the range, which is what a sensor reads where it "
        "senses nothing. Dotted line: where the teacher begins to see an obstacle.",
        pd.concat(maps, names=["controller"]).reset_index("controller"),
    )


def _timelines(run: Run, page: Page) -> None:
    kept = run.kept("trajectories", run.programs)
    if run.episode is None or not kept:
        return
    lines = {name: steps.loc[steps.episode == run.episode] for name, steps in kept.items()}
    page.section("Similarity and familiarity over time").figure(
        "timelines",
        lambda: figures.timelines(lines),
        "Readings, similarity, margin and familiarity over one episode",
        "How sure a program is while it drives. Similarity: cosine of its noisy answer with the result that wins. "
        "Margin: how far the next result lies below. Familiarity: cosine of the condition with the sum of those known; "
        "low where a condition was rarely met or never. Background: the rule that the teacher would follow. Bottom: "
        "red marks where the command differs from the teacher's, blue marks for the behaviour that spoke, where "
        "several are combined.",
        pd.concat(lines, names=["controller"]).reset_index("controller"),
    )


def _printed(run: Run, page: Page) -> None:
    names = run.those(["paper", "paper_best_bins"])
    if not names:
        return
    section = page.section("Why the printed algorithm does what it does")
    records = run.outcome.records
    learned = records.loc[(records.kind == "learning") & records.controller.isin(names)]
    section.table(tables.COUNTS.show(learned.sort_values("controller").to_dict(orient="records")))
    if "paper_best_bins" in names:
        section.table(tables.CANDIDATES.show(records.loc[records.kind == "candidate"].to_dict(orient="records")))
    panels = {int(frame.bins.iloc[0]): frame for frame in run.kept("recall", names).values() if len(frame)}
    if not panels:
        return
    every = pd.concat(panels.values())
    means = [panel[["bins", "conditions", *ABOUT]].mean() for panel in panels.values()]
    section.table(tables.RECALL.show(pd.DataFrame(means).to_dict(orient="records")))
    section.figure(
        "recall_by_age",
        lambda: figures.recall_by_age(list(panels.values())),
        "Recall of demonstrated conditions by how many came after them",
        "The same conditions in groups of equal size. Dotted: the recall of a program that always answers with the "
        "most frequent command.",
        every,
    )
    reason = why_it_forgets(panels.values())
    if reason and run.outcome.config["paper"]["rule"].get("clip_each_step"):
        section.text(reason)


def why_it_forgets(panels: Iterable[pd.DataFrame]) -> str:
    """Why clipping after each addition forgets, with the measured recall; empty where it does not."""
    found = []
    for recall in panels:
        shares = by_age(recall, CLIPPED, 5).recall
        newest, oldest = shares.iloc[-1], shares.iloc[0]
        if newest - oldest > 0.05:
            found.append(
                f"{newest:.0%} of the newest fifth and {oldest:.0%} of the oldest at {recall.bins.iloc[0]} bins"
            )
    if not found:
        return ""
    return (
        "Why it forgets: after a clip no element of the program is larger than that of one pair, however many pairs "
        "agreed on it. So each new pair weighs as much as all the older ones together. Of the conditions, "
        f"`{CLIPPED}` recalls {', '.join(found)}."
    )


def _failures(run: Run, page: Page) -> None:
    names = [name for name in run.outcome.settings.controllers if name not in REFERENCES]
    if not names:
        return
    section = page.section("Where it fails")
    section.table(tables.FAILURES.show(tables.failing(run.episodes, names)))
    if mistakes := tables.most_frequent_mistakes(run.outcome.records, names):
        section.table(tables.MISTAKES.show(mistakes))
