"""First to one lamp, then to the other: one vector of contexts and transitions, and the second goal never demonstrated.

Plain functions that return numbers. 'To blue' is learned from runs of the teacher towards the blue lamp, with a pair of
light sensors per colour. In the codes one involution swaps the colours, so that `behaviour.mirror()` is 'to yellow'.
The transition is learned from the readings of the same runs, at the blue lamp and before it. See
`behaviours.Sequencing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool
from numpy.typing import NDArray
from torch import Tensor

import sim
from behaviours import BehaviourBank, Demonstrations, ErrorDriven, Rule, Sequencing, Space
from experiments.kit import Column, Table
from experiments.tasks import corral
from experiments.tasks.agreement import share_right
from torchvsa import MAP
from torchvsa.encoders import Level, Mirrored

DIM, BINS = 4000, 32
MIRROR = {"blue_left": "yellow_left", "blue_right": "yellow_right"}
SENSORS = ("blue_left", "blue_right", "distance")
"""The sensors that 'to blue' uses; its mirror image uses the yellow ones."""
RULE = ErrorDriven()
SWITCHING = ErrorDriven(margin=5)
TASK = sim.Task(lights=("blue", "yellow"), goals=("blue", "yellow"))
SECONDS = 120.0
"""Longest duration of an episode. The teacher that succeeds takes half a minute; in 240 s it succeeds no more often."""


def room(side: float = 4.0, apart: float = 2.0) -> sim.Arena:
    """A closed room with a blue lamp and a yellow one, `apart` in x and in y.

    In the arena `two_lamps` the teacher fails where it leaves the corral before it has found the blue lamp inside, and
    then never comes back; here it cannot leave.
    """
    half, lamp = side / 2, apart / 2
    floor, outline = (sim.Box(0.0, 0.0, reach, reach) for reach in (half, half + 0.06))
    lamps = sim.Lamp(-lamp, lamp, colour="blue"), sim.Lamp(lamp, -lamp, colour="yellow")
    return sim.Arena(tuple(sim.walls(floor)), lamps, floor, outline)


def space(codebook: int) -> Space:
    """Level codes, in which one involution swaps the colours and leaves distance and wheels as they are."""
    columns = [channel.name for channel in TASK.sensors]
    pairs = [(columns.index(first), columns.index(second)) for first, second in MIRROR.items()]
    encoder = Mirrored(Level(MAP(DIM, dtype=torch.int8), BINS), pairs, len(columns))
    return Space(corral.schema(sensors=TASK.sensors), encoder, seed=codebook, mirror=MIRROR)


@dataclass(frozen=True)
class Runs:
    """Runs of the teacher to one lamp.

    Attributes:
        shown: All control steps, until the robot has stayed at the lamp for the dwell time.
        arrived: `[N]`, whether the robot touches the lamp.
    """

    shown: Demonstrations
    arrived: Bool[Tensor, "N"]


def runs(arena: sim.Arena, episodes: int = 20, goal: str = "blue", first: int = corral.FIRST_DEMONSTRATION) -> Runs:
    """Runs of `sim.InOrder` to one lamp only, by default from starts that are not tested."""
    task = sim.Task(TASK.lights, (goal,))
    driven = sim.rollout(
        sim.InOrder(task), arena, task=task, episodes=range(first, first + episodes), seconds=SECONDS / 2
    )
    shown, _ = corral.shown_in(driven)
    return Runs(shown, torch.from_numpy(driven.trajectory.at_lamp))


def bank(codebook: int, taught: Runs, rule: Rule = RULE) -> BehaviourBank:
    """'To blue', learned, and 'to yellow', its mirror image."""
    made = BehaviourBank(space(codebook))
    made.learn("to blue", taught.shown, rule, sensors=SENSORS)
    made.add("to yellow", made["to blue"].mirror())
    return made


def policy(codebook: int, taught: Runs, switching: Rule = SWITCHING) -> Sequencing:
    """Both behaviours and the transition between them in one vector; contexts and tag are drawn from the codebook."""
    transitions = {
        ("to blue", "to blue"): taught.shown.where(~taught.arrived),
        ("to blue", "to yellow"): taught.shown.where(taught.arrived),
    }
    return Sequencing(bank(codebook, taught), transitions, switching, seed=codebook)


def agreement(arena: sim.Arena, codebook: int, taught: Runs, tested: int = 200) -> float:
    """The share of steps, of teachers on their way to yellow, at which 'to yellow' commands what they do."""
    asked = runs(arena, tested, "yellow", first=0)
    moving = asked.shown.where(~asked.arrived)
    return share_right(bank(codebook, taught)["to yellow"], moving)


def succeeds(controller: sim.ControllerLike, arena: sim.Arena, starts: Sequence[int], engine: str) -> NDArray[np.bool_]:
    """For each start, whether the robot touches the blue lamp and then stays at the yellow one."""
    return sim.rollout(
        controller, arena, task=TASK, episodes=starts, seconds=SECONDS, engine=engine, record=False
    ).success


def compare(
    arena: sim.Arena, codebooks: Sequence[int] = range(10), starts: int = 500, engine: str = "vector"
) -> dict[str, dict[str, Any]]:
    """Success of the teacher and of the vector from the same starts, split over codebooks, with Wilson's intervals.

    Returns:
        The rows `teacher`, `one vector`, and `one vector, where the teacher succeeds`, each with `episodes`,
        `success_rate`, `success_low` and `success_high`.
    """
    taught = runs(arena)
    teacher = succeeds(sim.InOrder(TASK), arena, range(starts), engine)
    parts = np.array_split(np.arange(starts), len(codebooks))
    learned = np.concatenate(
        [
            succeeds(policy(codebook, taught), arena, part.tolist(), engine)
            for codebook, part in zip(codebooks, parts, strict=True)
        ]
    )
    rows = {"teacher": teacher, "one vector": learned, "one vector, where the teacher succeeds": learned[teacher]}
    return {name: corral.success(len(found), int(found.sum())) for name, found in rows.items()}


def table(rows: dict[str, dict[str, Any]]) -> str:
    """The rows of `compare` as a Markdown table."""
    columns = [
        Column("row"),
        Column("success_rate", "success", ".3f", interval=("success_low", "success_high")),
        Column("episodes", "starts", ".0f"),
    ]
    return Table("In sequence", columns).show([{"row": name, **row} for name, row in rows.items()]).markdown()
