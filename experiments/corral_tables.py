"""The tables of the main job's report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import sim
from behaviours import LearningReport
from experiments.agreement import Agreement
from experiments.failures import PLACES, Failures
from experiments.report import Cell

Table = tuple[list[str], list[list[str | Cell]]]

NONE = "\u2013"
"""What stands in a cell without a number."""


def settings(config: Mapping[str, Any]) -> list[list[str]]:
    """The settings that matter, in words."""
    encoder, printed, rule = config["encoder"], config["paper"], dict(config["rule"])
    name = rule.pop("name")
    return [
        ["architecture", f"{config['vsa']['name']}, d = {config['vsa']['dim']:,}, {config['vsa']['dtype']}"],
        [
            "default: readings",
            f"{encoder['bins']} bins a sensor, {encoder['values']} codes, joined by {config['record']['combine']}",
        ],
        ["default: protection", config["protection"]["name"]],
        ["default: learning rule", f"{name} ({', '.join(f'{key} {value}' for key, value in rule.items())})"],
        [
            "paper: readings",
            f"the same bins, {printed['encoder']['values']} codes, joined by {printed['record']['combine']}, "
            f"protection {printed['protection']['name']}",
        ],
        ["bundled: combination", config["composition"]["name"]],
        ["arena and body", f"{config['arena']['preset']}, {config['body']['name']}"],
        [
            "starts",
            f"{config['starts']:,} held out for teacher, default and bundled; {config['other_starts']:,} for others",
        ],
        ["seed", str(config["seed"])],
    ]


def number(value: float | int | None, digits: int = 3) -> str:
    """A number for a table: a dash for none, whole numbers with separators."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return NONE
    return f"{value:,}" if isinstance(value, int) else f"{value:,.{digits}f}"


def percent(share: float) -> str:
    """A share in per cent, never rounded up to all or down to none."""
    text = f"{share:.1%}"
    if (share < 1 and text == "100.0%") or (share > 0 and text == "0.0%"):
        return "more than 99.9 %" if share > 0.5 else "less than 0.1 %"
    return text.replace(".0%", "%").replace("%", " %")


def plural(count: int, noun: str) -> str:
    """`1 episode`, `2 episodes`."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def main_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """The table of the main job, with the best of each column and the failing controllers marked."""
    columns = ["controller", "episodes", "success [95 %]", "escape", "time (s)", "dwell", "collision"]
    columns += ["train", "held out", "unseen", "pairs", "bins", "query (µs)"]
    rivals = [row for row in rows if not row["controller"].startswith("teacher")]

    def best(key: str, sign: int = 1) -> float | None:
        values = [sign * round(row[key], 3) for row in rivals if row[key] is not None]
        return sign * max(values) if len(values) > 1 else None

    top = {key: best(key) for key in ("success_rate", "train_agreement", "heldout_agreement", "unseen_agreement")}
    top["time_to_light_s"] = best("time_to_light_s", -1)

    def cell(row: Mapping[str, Any], key: str, digits: int = 3) -> Cell:
        value = row[key]
        text = number(value, digits)
        if key == "success_rate":
            text += f" [{row['success_low']:.3f}, {row['success_high']:.3f}]"
            if value < 0.5:
                return Cell(text, "bad")
        leads = key in top and row in rivals and value is not None and round(value, 3) == top[key]
        return Cell(text, "best" if leads else "")

    table: list[list[str | Cell]] = []
    for row in rows:
        keys = ("success_rate", "escape_rate", "time_to_light_s", "dwell_fraction", "collision_fraction")
        keys += ("train_agreement", "heldout_agreement", "unseen_agreement", "pairs_stored", "bins", "query_us")
        digits = {"time_to_light_s": 1, "query_us": 0}
        cells = [cell(row, key, digits.get(key, 3)) for key in keys]
        table.append([row["controller"], number(row["episodes"]), *cells])
    return columns, table


def agreement_table(agreements: Mapping[str, Agreement]) -> Table:
    """Agreement per condition, what is unseen, and agreement on all demonstrated samples."""
    columns = [
        "controller",
        "held out, per sample",
        "held out, per condition",
        "unseen share",
        "all demonstrated samples",
    ]
    return columns, [
        [name, *map(number, (one.heldout, one.heldout_distinct, one.unseen_share, one.train_all))]
        for name, one in agreements.items()
    ]


def counts_table(reports: Mapping[str, LearningReport]) -> Table:
    """What the one-shot rule decided about its samples."""
    columns = ["controller", "samples", "new", "re-added", "truly known", "falsely known", "contradicting"]
    return columns, [
        [name, *map(number, (r.samples, r.new, r.re_added, r.truly_known, r.falsely_known, r.contradicting))]
        for name, r in reports.items()
    ]


def tried_table(tried: Sequence[Mapping[str, float]]) -> Table:
    """The bins tried for the printed algorithm."""
    columns = ["bins", "success on validation starts", "agreement on all demonstrated samples"]
    return columns, [
        [str(int(row["bins"])), number(float(row["validation_success"])), number(row["train_agreement"])]
        for row in tried
    ]


def rules_table(agreements: Mapping[str, Agreement], edges: Mapping[str, float | None]) -> Table:
    """Agreement by the teacher's rule, and how much of the rest lies on the edge of a threshold."""
    columns = ["controller", *(rule.replace("_", " ") for rule in sim.TEACHER_RULES), "differs", "on the edge"]
    rows: list[list[str | Cell]] = []
    for name, agreement in agreements.items():
        shares = [agreement.by_rule.get(rule) for rule in sim.TEACHER_RULES]
        cells = [Cell(number(share), "bad" if share is not None and share < 0.5 else "") for share in shares]
        rows.append([name, *cells, number(1 - agreement.heldout), number(edges[name])])
    return columns, rows


def ends_table(failed: Mapping[str, Failures], rollouts: Mapping[str, sim.Rollout]) -> Table:
    """How many episodes failed, where their robots were at the end, and how many steps differed."""
    columns = ["controller", "failed", "of", *PLACES, "steps unlike the teacher's"]
    return columns, [
        [
            name,
            number(len(one.episodes)),
            number(len(rollouts[name])),
            *(number(one.ends[place]) for place in PLACES),
            number(one.wrong) if len(one.episodes) else NONE,
        ]
        for name, one in failed.items()
    ]


def mistakes_table(failed: Mapping[str, Failures], most: int = 3) -> Table:
    """The most frequent differences of each controller that fails."""
    columns = ["controller", "where the teacher would", "it commands", "share of steps", "readings (m)"]
    return columns, [
        [
            name,
            mistake.rule.replace("_", " "),
            mistake.command,
            number(mistake.share),
            ", ".join(f"{reading:.2f}" for reading in mistake.readings),
        ]
        for name, one in failed.items()
        for mistake in one.mistakes[:most]
    ]


def bodies_table(rollouts: Sequence[sim.Rollout]) -> Table:
    """Success with its interval on several bodies, on the starts that all of them drove."""
    rows: list[list[str | Cell]] = []
    for rollout, success in zip(rollouts, shared_success(rollouts), strict=True):
        low, high = sim.wilson(int(success.sum()), len(success))
        rows.append([rollout.body, number(len(success)), f"{success.mean():.3f} [{low:.3f}, {high:.3f}]"])
    return ["body", "episodes", "success [95 %]"], rows


def shared_success(rollouts: Sequence[sim.Rollout]) -> list[NDArray[np.bool_]]:
    """For each rollout, which of the starts that all of them drove it solved."""
    shared = sorted(set.intersection(*(set(rollout.episode.tolist()) for rollout in rollouts)))
    return [rollout.success[np.isin(rollout.episode, shared)] for rollout in rollouts]
