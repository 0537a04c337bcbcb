"""The teacher's rules as one hypervector written by hand: the manual design that learning is compared with.

Source: the rules of Neubert et al. 2016, section IV; bundling hand-made rules follows Levy et al. 2014, whom the
paper cites as [10].
"""

import torch

import sim
from behaviours import Behaviour, LearningReport, Schema, Sensor, Space
from experiments.presets import schema as learners_schema
from sim.sensors import LIGHT_MAX
from sim.teacher import COMMANDS, OBSTACLE
from torchvsa import VSA
from torchvsa.encoders import Lookup, Sum

YES, NO, EITHER = 0, 1, -1
"""Whether a reading is below its threshold (bin 0 of 2), is not, or does not matter (left out of the condition)."""

RULES: tuple[tuple[tuple[int, int, int], int], ...] = (
    ((YES, YES, EITHER), 2),  # stay in light
    ((YES, NO, EITHER), 4),  # turn left to light
    ((NO, YES, EITHER), 4),  # turn right to light
    ((NO, NO, YES), 1),  # avoid obstacle
    ((NO, NO, NO), 1),  # cruise
)
"""(light left, light right, obstacle) and the weight of each rule, in the order of `sim.RULES`.

A bundle has no `else`, so a rule also speaks, more softly, where its condition holds in part, and results that agree
in one wheel support each other. The weights were found by hand: with s the sum of weight · (sensors that match, and
one more for a complete match of three), `left` must beat `forward` and `right` together, and so on, in all 8 cases.
"""


def space(vsa: VSA, seed: int) -> Space:
    """Two bins per sensor, which part at the rules' thresholds: a designer may know them, a learner may not."""
    thresholds = (LIGHT_MAX, LIGHT_MAX, OBSTACLE)
    sensors = [
        # The reading at a light sensor's maximum is the first that counts as dark.
        Sensor(name, 0.0, 2 * threshold, unit, out_of_range="clip")
        for (name, _, _, unit), threshold in zip(sim.SENSORS, thresholds, strict=True)
    ]
    schema = Schema(sensors, learners_schema().actuators)
    return Space(schema, Sum(Lookup(vsa, bins=2), len(sensors)), seed=seed)


def behaviour(vsa: VSA, seed: int) -> Behaviour:
    """Five weighted rules, bundled raw into one program."""
    codes = space(vsa, seed)
    conditions = codes.encode(torch.tensor([condition for condition, _ in RULES]))
    commands = codes.schema.command_levels(COMMANDS)
    weights = torch.tensor([weight for _, weight in RULES])
    program = vsa.superpose(vsa.bind(conditions, codes.items(commands)), weights=weights)
    results = commands[:3]  # avoid and cruise repeat the commands of the first two rules
    report = LearningReport("hand_written", samples=len(RULES), new=len(RULES))
    return Behaviour(codes, program, vsa.superpose(conditions), results, report)
