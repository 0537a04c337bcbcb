"""The teacher's rules as one hypervector written by hand: the manual design that learning is compared with.

Source: the rules of Neubert et al. 2016, section IV; bundling hand-made rules follows Levy et al. 2014, whom the
paper cites as [10].
"""

from itertools import product

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

import sim
from behaviours import Behaviour, LearningReport, Schema, Sensor, Space
from behaviours.ordered import distinct_rows
from experiments.models.largest_margin import largest_margin, margin, whole
from experiments.tasks.corral import schema as learners_schema
from sim.sensors import LIGHT_MAX
from sim.teachers.escape import OBSTACLE, TEACHER_COMMANDS
from torchvsa import VSA
from torchvsa.encoders import Lookup, Sum

YES, NO, EITHER = 0, 1, -1
"""Whether a reading is below its threshold (bin 0 of 2), is not, or does not matter (left out of the condition)."""

RULES: tuple[tuple[int, int, int], ...] = (
    (YES, YES, EITHER),  # stay in light
    (YES, NO, EITHER),  # turn left to light
    (NO, YES, EITHER),  # turn right to light
    (NO, NO, YES),  # avoid obstacle
    (NO, NO, NO),  # cruise
)
"""(light left, light right, obstacle), in the order of `sim.TEACHER_RULES`.

Each of the 8 cases fulfils exactly one of them.
"""

CASES: tuple[tuple[int, ...], ...] = tuple(product((YES, NO), repeat=3))
"""All that the three thresholds can tell apart."""

BY_HAND: tuple[int, ...] = (2, 4, 4, 1, 1)
"""Weights of the rules, found by hand for sums, in which a case resembles a rule by the sensors that agree.

A bundle has no `else`, so a rule also speaks, more softly, where its condition holds in part, and results that agree
in one wheel support each other. How much depends on the architecture: a case has the cosine .71 with a light rule that
holds (MAP-C), as a majority .50 (MAP-B, BSC); `left` has .35 with `forward` and -.29 with `right`, as majorities .10
and .35.
"""

ENOUGH = 0.25
"""The share of the largest margin at which `BY_HAND` will do. At d = 4,000 its median over 30 codebooks is .55 (MAP-C),
.41 (MAP-I) and .44 (FHRR); about 0 with HRR, where the noise of the codebooks decides; and -2.9 with MAP-B and BSC,
where two of the cases are wrong with every codebook."""


def space(vsa: VSA, seed: int) -> Space:
    """Two bins per sensor, which part at the rules' thresholds: a designer may know them, a learner may not."""
    thresholds = (LIGHT_MAX, LIGHT_MAX, OBSTACLE)
    sensors = [
        # The reading at a light sensor's maximum is the first that counts as dark.
        Sensor(sensor.name, 0.0, 2 * threshold, sensor.unit, out_of_range="clip")
        for sensor, threshold in zip(sim.SENSORS, thresholds, strict=True)
    ]
    schema = Schema(sensors, learners_schema().actuators)
    return Space(schema, Sum(Lookup(vsa, bins=2), len(sensors)), seed=seed)


def written(vsa: VSA) -> tuple[tuple[int, ...], ...]:
    """The conditions that are written down: five rules, or all eight cases if keys that differ a little are unrelated.

    A rule speaks in a case because their conditions are similar. Where binding is not bilinear, as with shifts, only
    equal conditions find each other.
    """
    return RULES if vsa.bilinear else CASES


def behaviour(vsa: VSA, seed: int) -> Behaviour:
    """Five weighted rules (see `written`), bundled raw into one program.

    Raises `ValueError` for codebooks with which no weights make the program right in all 8 cases.
    """
    codes = space(vsa, seed)
    rules = written(vsa)
    conditions, cases = codes.encode(torch.tensor(rules)), codes.encode(torch.tensor(CASES))
    results, result_of = distinct_rows(
        codes.schema.command_levels(TEACHER_COMMANDS)
    )  # avoid and cruise repeat a command
    right = result_of[[_fires(case) for case in CASES]]
    items = codes.items(results)
    pairs = vsa.bind(items[result_of if vsa.bilinear else right], conditions)
    # Scores are linear in the program, so those of the bundle are the weighted sum of those of the single pairs.
    weights = _weights(vsa.readout(pairs, items)(cases), right)
    report = LearningReport("hand_written", samples=len(rules), new=len(rules))
    made = Behaviour(codes, vsa.superpose(pairs, weights=weights), vsa.superpose(conditions), results, report)
    answers = codes.schema.command_levels(made.query(cases).commands)
    if (answers != results[right]).any():
        raise ValueError(
            f"no weights of the {len(rules)} rules make a bundle that is right in all 8 cases with {vsa} and seed "
            f"{seed}; take more dimensions (vsa.dim), or leave out hand_written"
        )
    return made


def _fires(case: tuple[int, ...]) -> int:
    """The rule whose condition holds."""
    return next(i for i, rule in enumerate(RULES) if all(b in (a, EITHER) for a, b in zip(case, rule, strict=True)))


def _weights(scores: Float64[Tensor, "8 rules 3"], right: Int64[Tensor, "8"]) -> Int64[Tensor, "rules"]:
    """Weights with which the `right` result scores highest in each case, given the scores of each rule by itself.

    All are 0 if there are none.
    """
    leads = np.array(
        [
            (by_rule[:, wanted] - by_rule[:, rival]).numpy()
            for by_rule, wanted in zip(scores, right.tolist(), strict=True)
            for rival in range(by_rule.shape[1])
            if rival != wanted
        ]
    )
    best, by_hand = largest_margin(leads), np.array(BY_HAND)
    if not best.any():
        return torch.zeros(leads.shape[1], dtype=torch.int64)
    if len(best) != len(by_hand):
        return torch.from_numpy(whole(leads, best))
    will_do = margin(leads, by_hand) >= ENOUGH * margin(leads, best)
    return torch.from_numpy(by_hand if will_do else whole(leads, best))
