"""What a program still recalls of the conditions it was shown, by how many came after them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from behaviours import Demonstrations, OneShot, Rule, Space
from behaviours.learning import no_convergence_warnings
from behaviours.ordered import distinct_rows
from experiments import presets

PRINTED, CLIPPED, MEAN, SUM, DEFAULT = "as printed", "clipped", "raw, mean width", "raw, sum width", "default"
"""The learners that are compared, each one step away from its neighbours."""

ABOUT = {
    PRINTED: "Algorithm 1 with the settings of `paper`, its own test for what is known among them",
    CLIPPED: "each condition added once, at its first appearance, with a clip after each addition",
    MEAN: "the same pairs in a raw sum",
    SUM: "the same with shift widths from the index sum, which spread evenly",
    DEFAULT: "the rule and the encoding of `default`",
}


@dataclass(frozen=True)
class Recalled:
    """Which conditions each learner recalls.

    Attributes:
        bins: per sensor.
        conditions: distinct conditions shown, those with several commands included.
        age: `[k]`, for each condition that was shown with one command only, oldest first: how many distinct
            conditions appeared after it.
        guess: the recall of a program that always answers with the most frequent command.
        right: by learner, `[k]`: whether its program answers the condition with the command that was shown.
    """

    bins: int
    conditions: int
    age: NDArray[np.int64]
    guess: float
    right: dict[str, NDArray[np.bool_]]

    def share(self, learner: str) -> float:
        """The share of these conditions that a learner recalls."""
        return float(self.right[learner].mean())

    def by_age(self, learner: str, groups: int = 10) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean age and recall of up to `groups` groups of equal size, oldest first.

        Groups of fewer than eight conditions would show chance more than age, so few conditions make few groups.
        """
        groups = max(1, min(groups, len(self.age) // 8))
        parts = [np.array_split(column, groups) for column in (self.age, self.right[learner])]
        age, recall = ([float(part.mean()) for part in column] for column in parts)
        return np.array(age), np.array(recall)


def learners(config: Mapping[str, Any], bins: int) -> dict[str, tuple[Space, Rule]]:
    """Codebooks and rule of each learner for a run's settings, at the given bins."""
    printed = config["paper"]
    seed = config["seed"]

    def shifted(width: str) -> Space:
        parts = {**printed, "protection": {"name": "self_shift", "width": width}}
        return presets.space(config["vsa"], parts, seed, bins)

    as_printed = presets.space(config["vsa"], printed, seed, bins)
    return {
        PRINTED: (as_printed, presets.rule(printed["rule"])),
        CLIPPED: (shifted("mean"), OneShot(clip_each_step=True)),
        MEAN: (shifted("mean"), OneShot()),
        SUM: (shifted("sum"), OneShot()),
        DEFAULT: (presets.space(config["vsa"], config, seed, bins), presets.rule(config["rule"])),
    }


@torch.no_grad()
def recalled(rules: Mapping[str, tuple[Space, Rule]], shown: Demonstrations) -> Recalled:
    """Learn the demonstrations with each rule, then ask for every condition that was shown with one command."""
    first = next(iter(rules.values()))[0]
    conditions, which = distinct_rows(first.cells(shown.sensors))
    results, result = distinct_rows(first.schema.command_levels(shown.commands))
    pairs = torch.stack([which, result], 1).unique(dim=0)
    single = torch.bincount(pairs[:, 0], minlength=len(conditions)) == 1
    if not single.any():
        nothing = np.zeros(0, dtype=np.int64)
        return Recalled(first.encoder.bins, len(conditions), nothing, 0.0, dict.fromkeys(rules, nothing > 0))
    wanted = torch.zeros(len(conditions), dtype=torch.int64)
    wanted[pairs[:, 0]] = pairs[:, 1]
    right = {}
    for name, (space, rule) in rules.items():
        with no_convergence_warnings():  # the recall says it
            behaviour = rule.fit(space, shown)
        asked = space.encode(conditions[single])
        answers = torch.cat([behaviour.query(block).commands for block in asked.split(1024)])
        match = space.schema.command_levels(answers) == results[wanted[single]]
        right[name] = match.all(-1).numpy()
    age = (len(conditions) - 1 - torch.arange(len(conditions)))[single].numpy()
    guess = float(torch.bincount(wanted[single]).max() / single.sum())
    return Recalled(first.encoder.bins, len(conditions), age, guess, right)
