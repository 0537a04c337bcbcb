"""The words of the page. Every claim is made from the numbers of the run at hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

import sim
from experiments.corral.forgetting import CLIPPED, DEFAULT, MEAN, PRINTED, SUM, by_age
from experiments.corral.tables import is_learner, shared_success
from experiments.kit import Outcome, Row

ANIMATION = (
    "Teacher and `{name}` from held-out start {episode}. Both begin in the same place with the same wheel noise in "
    "store, and part as soon as one command differs."
)
MAPS = (
    "Each small square is one condition: a bin of two sensors, while the third is held. Its colour is the command. "
    "A program answers everywhere, also where nothing was ever demonstrated; dots show where the teacher's "
    "held-out runs have been; a hatched square without a dot was never met in them."
)
MAPS_CAPTION = (
    "Asked at the middle of each bin; in the last bin at the end of the range, which is what a sensor reads where "
    "it senses nothing. Dots: held-out samples in which the third sensor tells the teacher the same as here. "
    "Dotted line: where the teacher begins to see an obstacle."
)
TIMELINES = (
    "How sure a program is while it drives. Similarity: cosine of its noisy answer with the result that wins. "
    "Margin: how far the next result lies below. Familiarity: cosine of the condition with the sum of those known; "
    "low where a condition was rarely met or never."
)
TIMELINES_CAPTION = (
    "Background: the rule that the teacher would follow. Bottom: red marks where the command differs from the "
    "teacher's, blue marks for the behaviour that spoke, where several are combined."
)
RECALL = (
    "What does each step of the algorithm cost? The same demonstrations, learned in five ways, then asked condition by "
    "condition, sorted by how many other conditions were met afterwards:"
)
RECALL_CAPTION = (
    "Conditions that were shown with one command only, in groups of equal size. Dotted: the recall of a program "
    "that always answers with the most frequent command."
)


def percent(share: float) -> str:
    """A share in per cent, never rounded up to all or down to none."""
    text = f"{share:.1%}"
    if (share < 1 and text == "100.0%") or (share > 0 and text == "0.0%"):
        return "more than 99.9 %" if share > 0.5 else "less than 0.1 %"
    return text.replace(".0%", "%").replace("%", " %")


def plural(count: int, noun: str) -> str:
    """`1 episode`, `2 episodes`."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def headline(outcome: Outcome) -> str:
    """What one hypervector achieves, and the printed algorithm."""
    rows = {row["controller"]: row for row in outcome.table}

    def reached(row: Row) -> str:
        return f"{row['success_rate'] * row['episodes']:,.0f} of {plural(row['episodes'], 'start')}"

    first = next((row for row in outcome.table if is_learner(row)), outcome.table[0])
    row = rows.get("default", first)
    if row["controller"] == "default":
        dim = outcome.config["vsa"]["dim"]
        text = f"One hypervector of {dim:,} numbers drives the robot to the lamp from {reached(row)} that it never saw"
    else:
        text = f"`{row['controller']}` drives the robot to the lamp from {reached(row)}"
    others = [f"`{name}` from {reached(rows[name])}" for name in ("teacher", "paper") if name in rows]
    others = [other for other in others if not other.startswith(f"`{row['controller']}`")]
    return text + (f"; {', '.join(others)}." if others else ".")


def lead(outcome: Outcome) -> str:
    """What was run, in two sentences."""
    config = outcome.config
    shown = f"{config['demonstrations']:,} such runs are the demonstrations that are learned here"
    if config["demonstrations_file"] is not None:
        shown = "demonstrations from a file are learned here"
    return (
        f"A simulated robot leaves a corral and finds a lamp, driven by a teacher's five rules; {shown}, as one vector "
        f"of {config['vsa']['dim']:,} numbers. Each controller below then drives by itself from starts that it was "
        f"never shown, for at most {config['seconds']:g} s."
    )


def map_summary(name: str, maps: pd.DataFrame) -> str:
    """How much of the maps of one program differs from the teacher, and how much of that matters."""
    differs, met = maps.learned != maps.teacher, maps.samples > 0
    return (
        f"`{name}` differs from the teacher in {percent(differs.mean())} of these {len(maps):,} conditions. The "
        f"teacher's held-out runs met {met.sum():,} of them; in {(differs & met).sum():,} of those it differs."
    )


def timeline_summary(name: str, line: pd.DataFrame) -> str:
    """One episode in numbers."""
    text = (
        f"`{name}`, {plural(len(line), 'control step')}: it differs from the teacher in {line.differs.sum():,}; "
        f"median similarity {line.similarity.median():.3f}"
    )
    if line.margin.notna().any():
        text += f", smallest margin {line.margin.min():.3f}"
    if "speaker" in line:
        counts = line.speaker.value_counts()
        text += "; spoken by " + ", ".join(f"{voice} {counts.get(voice, 0):,}" for voice in sim.BEHAVIOURS)
    return text + "."


def counts_summary(row: Row) -> str:
    """What the printed algorithm decided, each thing only where it applies."""
    text = f"`{row['controller']}` stored {plural(row['new'], 'distinct condition')}"
    if row["re_added"]:
        times = (row["new"] + row["re_added"]) / max(row["new"], 1)
        text += (
            f" and then took {row['re_added']:,} later samples of them for new again, so that each went in "
            f"{times:.1f} times on average"
        )
    text += "."
    if row["falsely_known"]:
        text += (
            f" {plural(row['falsely_known'], 'sample')} looked known although their condition had not been stored yet: "
            "what they showed was lost at that moment."
        )
    return text


def recall_summary(recall: pd.DataFrame, printed: Mapping[str, object]) -> list[str]:
    """What the steps between the printed algorithm and the default change, from the measured recall."""
    shares = {name: float(recall[name].to_numpy().mean()) for name in (PRINTED, CLIPPED, MEAN, SUM, DEFAULT)}
    ages = by_age(recall, CLIPPED, 5).recall.tolist()
    group = len(recall) // len(ages)
    text = (
        f"At {recall.bins.iloc[0]} bins, {plural(len(recall), 'condition')} shown with one command only: as printed, "
        f"the program recalls {percent(shares[PRINTED])} of them. With a clip after each addition and nothing else in "
        f"the way it is {percent(shares[CLIPPED])}: {percent(ages[-1])} of the newest {group:,}, {percent(ages[0])} of "
        f"the oldest {group:,}. A raw sum of the same pairs recalls {percent(shares[MEAN])}, evenly spread widths "
        f"{percent(shares[SUM])}, and the rule and encoding of the default {percent(shares[DEFAULT])}."
    )
    steps = {
        "keeping the sum raw": shares[MEAN] - shares[CLIPPED],
        "spreading the widths": shares[SUM] - shares[MEAN],
        "the default's rule and encoding": shares[DEFAULT] - shares[SUM],
    }
    largest = max(steps, key=lambda step: steps[step])
    if steps[largest] <= 0:
        text += " None of these steps gains anything here."
    else:
        text += f" The largest gain comes from {largest} (+{100 * steps[largest]:.1f} points)."
    paragraphs = [text]
    if printed.get("clip_each_step") and ages[-1] - ages[0] > 0.05:
        paragraphs.append(
            "The reason: after a clip no element of the program is larger than that of one pair, however many pairs "
            "agreed on it. So each new pair weighs as much as all the older ones together, and the older a pair is, "
            "the less is left of it."
        )
    return paragraphs


def edge_summaries(rows: Sequence[Row]) -> list[str]:
    """For each controller that differs mostly on the edge of a threshold: by how much, and what that means."""
    return [
        f"`{row['controller']}` differs from the teacher in {percent(row['differs'])} of the held-out samples, and "
        f"{percent(row['ambiguous_share'])} of those lie in bins that one of the teacher's thresholds cuts in two, "
        "where the same condition asks for one command or for another."
        for row in rows
        if (row.get("ambiguous_share") or 0) > 0.5
    ]


def failure_summary(rows: Sequence[Row]) -> str:
    """Who fails for want of the right command, and who does although its commands are the teacher's."""
    without = [f"`{row['controller']}`" for row in rows if not row["failed"]]
    alike = [f"`{row['controller']}`" for row in rows if row["failed"] and row["unlike_teacher"] == 0]
    sentences = []
    if without:
        sentences.append(f"No failing episode: {', '.join(without)}.")
    if alike:
        sentences.append(
            f"Failed although every command was the teacher's (bad luck of start and noise): {', '.join(alike)}."
        )
    return " ".join(sentences)


def bodies_summary(episodes: pd.DataFrame, bodies: Mapping[str, str]) -> str:
    """How far two bodies differ, on the starts that both drove."""
    planar, wheeled = shared_success(episodes, ["teacher", "teacher_wheeled"]).values()
    difference = np.abs(planar.mean() - wheeled.mean())
    return (
        f"On the same {len(planar):,} starts the teacher's success differs by {difference:.3f} "
        f"between the {bodies['teacher_wheeled']} robot, simulated with its wheels on the floor, and the "
        f"{bodies['teacher']} one, moved by its velocities."
    )
