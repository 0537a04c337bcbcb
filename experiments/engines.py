"""Do the two engines say the same? The same controllers drive from the same starts in `vector` and in `bullet`.

Success, time to the lamp and collisions are compared in every arena, and single paths until the robot first touches
anything: after that a difference in the last digit grows, and paths part.

    torchvsa engines
    torchvsa engines arenas=[default,clutter] controllers=[teacher] starts=200
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import sim
from behaviours import BehaviourBank
from experiments.kit import Cell, Column, Drawing, Outcome, Part, Row, Study, Table, grid, part, parts, setting
from experiments.kit.figures import BLUE, VERMILION
from experiments.kit.intervals import mean
from experiments.tasks import corral
from sim import render

MEASURES = {"success": "success", "time_to_light_s": "time to the lamp (s)", "collisions": "share of time in contact"}
"""What is compared, as means over the starts; the time of successful episodes only."""


@dataclass
class Engines(corral.Learning):
    """The settings of this study."""

    composition: Part = part("composition", "bundle", "how `bundled` combines its behaviours")
    arenas: list[str] = setting(list(sim.ARENAS), "arenas", choices=sim.ARENAS, distinct=True)
    controllers: list[str] = setting(
        ["teacher", "default", "bundled"], "what drives; the learned ones in arenas with one light only",
        choices=["teacher", "default", "bundled"], distinct=True,
    )  # fmt: skip
    starts: int = corral.episodes(1000, "common starts", low=2)
    demonstrations: int = corral.episodes(60, "episodes of the teacher to learn from")


def check(settings: Engines) -> None:
    """Raise for engines that cannot drive, and for what cannot be learned or combined."""
    if settings.engine != "vector":
        raise ValueError(f"engine={settings.engine}: this study drives in both engines")
    corral.check_driving(settings, *sim.ENGINES)
    corral.check_policy(corral.check_learning(settings), settings.composition)


def cells(settings: Engines) -> list[Cell]:
    """A cell for each controller and arena, which drives in both engines."""
    found = grid(arena=settings.arenas, controller=settings.controllers)
    return [cell for cell in found if cell["controller"] == "teacher" or cell["arena"] in corral.arenas()]


def prepare(settings: Engines, folder: Path, progress: Any) -> dict[str, Any]:
    """Let the teacher demonstrate in the default arena, and learn."""
    episodes = range(corral.FIRST_DEMONSTRATION, corral.FIRST_DEMONSTRATION + settings.demonstrations)
    train = corral.moving(corral.drive_together(settings, "teacher demonstrates", sim.Teacher(), episodes, progress))
    space, rule = corral.space(settings), parts.rule(settings.rule)
    bank = BehaviourBank(space)
    for name, samples in corral.by_behaviour(train).items():
        bank.learn(name, samples, rule)
    learned = {"default": rule.fit(space, train), "bundled": parts.policy(bank, settings.composition)}
    return {"settings": settings, **learned}


def measure(material: dict[str, Any], cell: Cell) -> list[Row]:
    """A row for each start and engine, and how far the two paths are apart before the first touch, m."""
    settings, name = material["settings"], cell["controller"]
    arena = sim.find_arena(cell["arena"])
    controller = sim.InOrder(sim.Task.of(arena)) if name == "teacher" else material[name]
    runs = [
        corral.drive(replace(settings, engine=engine), controller, range(settings.starts), arena, record=True)
        for engine in sim.ENGINES
    ]
    rows = []
    for episode in range(settings.starts):
        apart = before_touch(arena, *(run.slice(episode) for run in runs))
        for engine, run in zip(sim.ENGINES, runs, strict=True):
            success, seconds = float(run.success[episode]), float(run.time_to_light[episode])
            row = {"engine": engine, "episode": episode, "success": success, "apart_m": apart}
            row |= {"collisions": float(run.collisions[episode]), "time_to_light_s": seconds if success else None}
            rows.append(row)
    return rows


def before_touch(arena: sim.Arena, one: sim.Steps, other: sim.Steps) -> float:
    """The largest distance between two paths, m, before either touches an obstacle or a lamp."""
    steps = min(len(one), len(other))
    touches = np.zeros(steps, dtype=np.bool_)
    for path in (one, other):
        touches |= arena.touched(path.x[:steps], path.y[:steps])
    free = slice(int(np.argmax(touches)) if touches.any() else steps)
    return float(np.hypot(one.x[free] - other.x[free], one.y[free] - other.y[free]).max(initial=0.0))


def summarise(settings: Engines, records: pd.DataFrame) -> list[Row]:
    """A row for each arena, controller and measure: both means with bootstrap intervals over the starts."""
    table: list[Row] = []
    for cell in cells(settings):
        own = records[(records.arena == cell["arena"]) & (records.controller == cell["controller"])]
        for measured in MEASURES:
            row = {**cell, "measure": measured}
            for engine in sim.ENGINES:
                values = own.loc[own.engine == engine, measured].dropna().to_numpy()
                row |= mean(engine, values)
            table.append({**row, "agree": agree(row), "apart_m": own.apart_m.max()})
    return table


def agree(row: Row) -> bool:
    """Whether each engine's mean is in the other's interval."""
    pairs = (sim.ENGINES, sim.ENGINES[::-1])
    if any(row[f"{engine}_low"] is None for engine in sim.ENGINES):
        return row["vector"] == row["bullet"]
    return all(row[f"{other}_low"] <= row[engine] <= row[f"{other}_high"] for engine, other in pairs)


def headline(outcome: Outcome) -> str:
    """How many comparisons agree, and how far paths are apart."""
    agreed, apart = sum(row["agree"] for row in outcome.table), max(row["apart_m"] for row in outcome.table)
    return (
        f"In {agreed} of {len(outcome.table)} comparisons each engine's mean is in the other's 95 % interval; before "
        f"robots touch anything, paths are at most {1000 * apart:.2g} mm apart."
    )


def intervals(outcome: Outcome) -> Figure:
    """Both means and intervals of each comparison."""
    figure = Figure(figsize=(10.5, 0.6 + 0.34 * len(outcome.table) / len(MEASURES)), layout="constrained")
    panels = figure.subplots(1, len(MEASURES), sharey=True)
    for axes, (measured, title) in zip(panels, MEASURES.items(), strict=True):
        rows = [row for row in outcome.table if row["measure"] == measured]
        for engine, colour, shift in zip(sim.ENGINES, (BLUE, VERMILION), (-0.15, 0.15), strict=True):
            for place, row in enumerate(rows):
                if row[engine] is not None:
                    axes.plot([row[f"{engine}_low"], row[f"{engine}_high"]], [place + shift] * 2, color=colour)
                    label = engine if place == 0 else None
                    axes.plot(row[engine], place + shift, "o", markersize=3.5, color=colour, label=label)
        axes.set_yticks(range(len(rows)), [f"{row['arena']}, {row['controller']}" for row in rows])
        axes.set_title(title)
    panels[0].invert_yaxis()
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def maps(outcome: Outcome) -> Figure:
    """The arenas from above, with paths of the teacher in `vector`."""
    names = outcome.settings.arenas
    figure = Figure(figsize=(12, 3.2 * -(-len(names) // 4)), layout="constrained")
    panels = figure.subplots(-(-len(names) // 4), 4, squeeze=False).flat
    for name, axes in zip(names, panels, strict=False):  # names first: what is left of the panels stays empty
        arena = sim.find_arena(name)
        shown = sim.rollout(sim.InOrder(sim.Task.of(arena)), arena, episodes=range(4), seed=outcome.settings.seed)
        render.draw_rollout(axes, shown, legend=False)
        axes.set_title(name)
    for axes in panels:
        axes.set_axis_off()
    return figure


TABLE = Table(
    "Both engines from the same starts",
    [
        Column("arena"),
        Column("controller"),
        Column("measure", format=lambda row: MEASURES[row["measure"]]),
        Column("vector", format=".4f", interval=("vector_low", "vector_high")),
        Column("bullet", format=".4f", interval=("bullet_low", "bullet_high")),
        Column(
            "agree", format=lambda row: "yes" if row["agree"] else "no", about="each mean is in the other's interval"
        ),
        Column("apart_m", "apart (m)", ".1e", about="largest distance between two paths before the first touch"),
    ],
)
METHOD = """
Each controller drives from the same starts with the same wheel noise, in `vector` and in `bullet` with the planar body.
Means are over the starts, the time to the lamp over successful ones; intervals are the bootstrap's, 95 %. The teacher
goes to all lamps of the arena in their order. `default` and `bundled` learned in the default arena.
"""

study = Study(
    name="engines",
    about="Does the fast engine say the same as the physics engine?",
    settings=Engines,
    check=check,
    cells=cells,
    prepare=prepare,
    measure=measure,
    summarise=summarise,
    keys=("arena", "controller", "measure"),
    table=TABLE,
    figures=[
        Drawing(
            "arenas",
            maps,
            "the arenas from above, with four paths of the teacher in each",
            "Orange: toward light; red: obstacle; blue: straight ahead. A cross marks an episode without success.",
        ),
        Drawing("engines", intervals, "means and intervals of both engines, by arena and controller"),
    ],
    headline=headline,
    method=METHOD,
    presets={"quick": {"arenas": ["default", "two_lamps"], "controllers": ["teacher"], "starts": 20}},
)
