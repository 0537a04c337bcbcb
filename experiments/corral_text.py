"""The words of the main job's report. Every claim is made from the numbers of the run at hand."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import OmegaConf

import sim
from behaviours import LearningReport
from experiments.agreement import Agreement
from experiments.command_map import CommandMap
from experiments.corral_tables import NONE, percent, plural, shared_success
from experiments.failures import Failures
from experiments.forgetting import CLIPPED, DEFAULT, MEAN, PRINTED, SUM, Recalled
from experiments.timeline import Timeline

DEFINITIONS = {
    "episodes": "held-out starts driven; none of them was demonstrated, and all controllers meet the same ones",
    "success": "share of episodes in which the robot touches the lamp and stays for the dwell time, with Wilson's "
    "95 % interval",
    "escape": "share of episodes in which the robot leaves the corral at any time",
    "time": "median time to the first touch of the lamp; a failed episode counts as longer than any other, "
    f"so there is no median ({NONE}) where half of them fail",
    "dwell": "of the control steps after first touching the lamp, the share spent at it",
    "collision": "share of control steps in contact with a wall",
    "agreement": "share of samples for which the controller commands what the teacher did. Left out everywhere: "
    "samples after the lamp was reached, since a robot at rest repeats one condition and would flatter every learner",
    "train": "agreement on the demonstrations, without the conditions that were shown with more than one command",
    "held out": "agreement on other runs of the teacher",
    "unseen": f"agreement on the held-out samples whose condition was never demonstrated; {NONE} where there is none",
    "pairs": "pairs of condition and command in the program, repetitions included (nearest neighbour: samples kept)",
    "bins": f"bins of equal width per sensor; {NONE} for controllers that see raw readings",
    "query": "median time of one answer for one robot, on the machine that ran this",
}

AGREEMENT_CAPTION = (
    "Agreement, counted in other ways. Per condition: each distinct held-out condition counts once, however often it "
    "was met, at the bins of `default` for all. Unseen share: how many held-out samples have a condition that was "
    "never demonstrated. All demonstrated samples: contradictions included, in which no program can always be right."
)
COUNTS_CAPTION = (
    "What the algorithm decided about the demonstrated samples, in the order in which it met them. New: stored for "
    "the first time. Re-added: stored again, as the memory no longer resembled it. Truly known: skipped, and stored "
    "before. Falsely known: skipped although never stored. Contradicting: stored before with another command."
)
RECALL_INTRODUCTION = (
    "What does each step of the algorithm cost? The same demonstrations, learned in five ways, then asked condition by "
    "condition, sorted by how many other conditions were met afterwards:"
)
RULES_CAPTION = (
    "Held-out agreement where each of the teacher's rules fires. Differs: share of held-out samples with another "
    "command than the teacher's. On the edge: of those, the share in bins in which the teacher itself gives several "
    "commands, since its threshold runs through the bin: there nobody who sees bins only can always be right."
)
MISTAKES_CAPTION = (
    "The commands that differ from the teacher's most often in the failing episodes: share of their control steps, and "
    "the median readings (left light, right light, distance) at which they were given."
)


def lead(config: Mapping[str, Any]) -> str:
    """What was run, in two sentences."""
    return (
        f"A simulated robot leaves a corral and finds a lamp, driven by a teacher's five rules; "
        f"{config['demonstrations']:,} such runs are the demonstrations that are learned here, as one vector of "
        f"{config['vsa']['dim']:,} numbers. Each controller below then drives by itself from starts that it was never "
        f"shown, for at most {config['seconds']:g} s."
    )


def map_summary(name: str, maps: Sequence[CommandMap]) -> str:
    """How much of the maps of one program differs from the teacher, and how much of that matters."""
    cells = sum(one.differs.size for one in maps)
    differs = sum(int(one.differs.sum()) for one in maps)
    met = sum(int((one.met > 0).sum()) for one in maps)
    both = sum(int((one.differs & (one.met > 0)).sum()) for one in maps)
    return (
        f"`{name}` differs from the teacher in {percent(differs / cells)} of these {cells:,} conditions. The teacher's "
        f"held-out runs met {met:,} of them; in {both:,} of those it differs."
    )


def timeline_summary(line: Timeline) -> str:
    """One episode in numbers."""
    text = (
        f"`{line.name}`, {plural(len(line.rule), 'control step')}: it differs from the teacher in "
        f"{line.differs.sum():,}; median similarity {np.median(line.similarity):.3f}"
    )
    if np.isfinite(line.margin).any():
        text += f", smallest margin {np.nanmin(line.margin):.3f}"
    if line.speaker is not None:
        counts = [(int((line.speaker == index).sum()), voice) for index, voice in enumerate(line.voices)]
        text += "; spoken by " + ", ".join(f"{voice} {count:,}" for count, voice in counts)
    return text + "."


def counts_summary(name: str, report: LearningReport) -> str:
    """The same in a sentence or two, each only where it applies."""
    parts = [f"`{name}` stored {plural(report.new, 'distinct condition')}"]
    if report.re_added:
        times = report.pairs / max(report.new, 1)
        parts.append(
            f" and then took {report.re_added:,} later samples of them for new again, so that each went in "
            f"{times:.1f} times on average"
        )
    text = "".join(parts) + "."
    if report.falsely_known:
        text += (
            f" {plural(report.falsely_known, 'sample')} looked known although their condition had not been stored yet: "
            "what they showed was lost at that moment."
        )
    return text


def recall_summary(panel: Recalled, printed: Mapping[str, Any]) -> list[str]:
    """What the steps between the printed algorithm and the default change, from the measured recall."""
    shares = {name: panel.share(name) for name in panel.right}
    _, ages = panel.by_age(CLIPPED, 5)
    part = len(panel.age) // len(ages)
    text = (
        f"At {panel.bins} bins, {plural(len(panel.age), 'condition')} shown with one command only: as printed, the "
        f"program recalls {percent(shares[PRINTED])} of them. With a clip after each addition and nothing else in the "
        f"way it is {percent(shares[CLIPPED])}: {percent(ages[-1])} of the newest {part:,}, {percent(ages[0])} of the "
        f"oldest {part:,}. A raw sum of the same pairs recalls {percent(shares[MEAN])}, evenly spread widths "
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


def edge_summaries(agreements: Mapping[str, Agreement], edges: Mapping[str, float | None]) -> list[str]:
    """For each controller that differs mostly on the edge of a threshold: by how much, and what that means."""
    return [
        f"`{name}` differs from the teacher in {percent(1 - agreements[name].heldout)} of the held-out samples, and "
        f"{percent(edge)} of those lie in bins that one of the teacher's thresholds cuts in two, where the same "
        "condition asks for one command or for another."
        for name, edge in edges.items()
        if edge is not None and edge > 0.5
    ]


def failure_summary(failed: Mapping[str, Failures]) -> str:
    """Who fails for want of the right command, and who does although its commands are the teacher's."""
    without = [f"`{name}`" for name, one in failed.items() if not len(one.episodes)]
    alike = [f"`{name}`" for name, one in failed.items() if len(one.episodes) and one.wrong == 0]
    parts = []
    if without:
        parts.append(f"No failing episode: {', '.join(without)}.")
    if alike:
        parts.append(
            f"Failed although every command was the teacher's (bad luck of start and noise): {', '.join(alike)}."
        )
    return " ".join(parts)


def bodies_summary(planar: sim.Rollout, wheeled: sim.Rollout) -> str:
    """How far two bodies differ, on the starts that both drove."""
    first, second = shared_success([planar, wheeled])
    return (
        f"On the same {len(first):,} starts the teacher's success differs by {abs(first.mean() - second.mean()):.3f} "
        f"between the {wheeled.body} robot, simulated with its wheels on the floor, and the {planar.body} one, moved "
        "by its velocities."
    )


def command(folder: Path) -> str:
    """The command line that runs this again: Hydra keeps what was given on it beside the results."""
    kept = folder / ".hydra" / "overrides.yaml"
    given = [str(item) for item in OmegaConf.to_container(OmegaConf.load(kept)) or []] if kept.is_file() else []
    return shlex.join(["python", "-m", "experiments.corral", *given])
