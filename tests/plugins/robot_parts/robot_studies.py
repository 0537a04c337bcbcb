"""An arena and a study of a user's own: how long does the teacher take in corrals with gaps of different widths?"""

from dataclasses import dataclass

import pandas as pd

import sim
from experiments.kit import Cell, Column, Row, Study, Table, grid, setting
from experiments.tasks.corral import Driving, drive


def hall(gap: float = 1.4) -> sim.Arena:
    """A large corral with two pillars."""
    return sim.corral(side=4.0, gap=gap, within=(sim.Pillar(-1.0, 0.8, 0.2), sim.Pillar(-1.0, -0.8, 0.2)))


sim.ARENAS["hall"] = hall


@dataclass
class Gaps(Driving):
    """The settings of this study."""

    arena: str = setting("hall", "the corral", choices=lambda: sim.ARENAS)
    gaps: list[float] = setting([0.8, 1.4], "widths of the gap, m", above=0, distinct=True)
    starts: int = setting(20, "episodes for each of them", low=1)


def measure(settings: Gaps, cell: Cell) -> list[Row]:
    """A row per episode."""
    arena = sim.ARENAS[settings.arena](gap=cell["gap"])
    rollout = drive(settings, sim.Teacher(), range(settings.starts), arena)
    return [
        {"episode": episode, "success": success}
        for episode, success in zip(rollout.episode.tolist(), rollout.success.tolist(), strict=True)
    ]


def summarise(settings: Gaps, records: pd.DataFrame) -> list[Row]:
    """The share of successful starts for each width."""
    return [{"gap": gap, "success": records.loc[records.gap == gap, "success"].mean()} for gap in settings.gaps]


study = Study(
    name="gaps",
    about="How wide must the gap be?",
    settings=Gaps,
    cells=lambda settings: grid(gap=settings.gaps),
    measure=measure,
    summarise=summarise,
    keys=("gap",),
    table=Table(
        "Success of the teacher", [Column("gap", "gap (m)", ".1f"), Column("success", format=".2f", best="max")]
    ),
)
