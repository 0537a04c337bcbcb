"""What a program still recalls of the conditions it was shown, by how many came after them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import torch

from behaviours import Demonstrations, OneShot, Rule, Space
from behaviours.learning import no_convergence_warnings
from behaviours.ordered import distinct_rows
from experiments.corral.controllers import printed_space
from experiments.kit import parts
from experiments.tasks import corral

if TYPE_CHECKING:
    from experiments.corral.settings import Corral

PRINTED, CLIPPED, MEAN, SUM, DEFAULT = "as printed", "clipped", "raw, mean width", "raw, sum width", "default"
"""The learners that are compared, each one step away from its neighbours."""

ABOUT = {
    PRINTED: "Algorithm 1 with the settings of `paper`, its own test for what is known among them",
    CLIPPED: "each condition added once, at its first appearance, with a clip after each addition",
    MEAN: "the same pairs in a raw sum",
    SUM: "the same with shift widths from the index sum, which spread evenly",
    DEFAULT: "the rule and the encoding of `default`",
}


def learners(settings: Corral, bins: int) -> dict[str, tuple[Space, Rule]]:
    """Codebooks and rule of each learner, at the given bins."""
    mean, total = ({"name": "self_shift", "width": width} for width in ("mean", "sum"))
    default = corral.space(settings, bins=bins if "bins" in settings.encoder else None)
    return {
        PRINTED: (printed_space(settings, bins), parts.rule(settings.paper.rule)),
        CLIPPED: (printed_space(settings, bins, mean), OneShot(clip_each_step=True)),
        MEAN: (printed_space(settings, bins, mean), OneShot()),
        SUM: (printed_space(settings, bins, total), OneShot()),
        DEFAULT: (default, parts.rule(settings.rule)),
    }


@torch.no_grad()
def recalled(rules: Mapping[str, tuple[Space, Rule]], shown: Demonstrations) -> pd.DataFrame:
    """Learn the demonstrations with each rule, then ask for every condition that was shown with one command.

    A row for each of these conditions, oldest first: its `age`, the number of distinct conditions that appeared after
    it; its `result`, a number for each command; and for each learner whether its program answers with that command. In
    all rows `conditions` is the number of distinct conditions shown, those with several commands included.
    """
    space = next(iter(rules.values()))[0]
    results, result = distinct_rows(space.schema.command_levels(shown.commands))
    samples = pd.DataFrame(
        {"condition": distinct_rows(space.cells(shown.sensors))[1].numpy(), "result": result.numpy()}
    )
    samples["single"] = samples.groupby("condition").result.transform("nunique") == 1
    first = samples.drop_duplicates("condition")
    asked = first.loc[first.single]
    frame = pd.DataFrame({"age": len(first) - 1 - asked.condition, "result": asked.result, "conditions": len(first)})
    for name, (space, rule) in rules.items():
        with no_convergence_warnings():  # the recall says it
            behaviour = rule.fit(space, shown)
        # Each learner asks by its own codes, with readings of the condition.
        levels = space.schema.command_levels(behaviour(shown.sensors[asked.index.tolist()]).commands)
        frame[name] = (levels == results[asked.result.tolist()]).all(-1).numpy()
    return frame.reset_index(drop=True)


def most_frequent(recall: pd.DataFrame) -> float:
    """The recall of a program that always answers with the most frequent command."""
    return float(recall.result.value_counts(normalize=True).iloc[0])


def by_age(recall: pd.DataFrame, learner: str, groups: int = 10) -> pd.DataFrame:
    """Mean `age` and `recall` of up to `groups` groups of equal size, oldest first.

    Groups of fewer than eight conditions would show chance more than age, so few conditions make few groups.
    """
    groups = max(1, min(groups, len(recall) // 8))
    columns = [np.array_split(recall[column].to_numpy(), groups) for column in ("age", learner)]
    age, share = ([float(chunk.mean()) for chunk in chunks] for chunks in columns)
    return pd.DataFrame({"learner": learner, "age": age, "recall": share})
