"""Show the corral escape, learn it as one hypervector, drive, and compare.

The teacher (the paper's five if-else rules) drives a simulated robot with real-valued sensors. Its runs are the
demonstrations. Each controller of the table learns from them or is a reference point, is asked about held-out runs
of the teacher (agreement), and then drives by itself from held-out starts (success).

    torchvsa corral
    torchvsa corral --multirun vsa.dim=1000,4000 seed=0,1
    torchvsa corral controllers=[teacher,default] encoder.bins=16
"""

import pandas as pd

from experiments.corral import tables
from experiments.corral.controllers import original
from experiments.corral.measure import measure, prepare
from experiments.corral.settings import PRESETS, Corral, check
from experiments.corral.trajectories import driven_episodes
from experiments.kit import Cell, Outcome, Page, Row, Study, grid
from experiments.kit.intervals import proportion

SLOWEST = (
    "default_wheeled",
    "teacher_wheeled",
    "default_bullet",
    "teacher_bullet",
    "paper_best_bins",
    "bundled",
    "default",
    "paper",
)


def cells(settings: Corral) -> list[Cell]:
    """A cell for each controller; those that take longest first."""
    order = [*(name for name in SLOWEST if name in settings.controllers), *settings.controllers]
    return grid(controller=dict.fromkeys(order))


def summarise(settings: Corral, records: pd.DataFrame) -> list[Row]:
    """A row for each controller, with its success on the starts that all controllers of the table drove."""
    rows, episodes = tables.measured(records), driven_episodes(records)
    success = tables.shared_success(episodes, settings.controllers)
    for name in settings.controllers:
        common = proportion("common", int(success[name].to_numpy().sum()), len(success))
        rows[name] |= {"common_episodes": len(success), **common, "minus_original": None}
        if original(name) != name and original(name) in settings.controllers:
            twins = tables.shared_success(episodes, [name, original(name)]).to_numpy().mean(axis=0)
            rows[name]["minus_original"] = float(twins[0] - twins[1])
    return [rows[name] for name in settings.controllers]


def metrics(settings: Corral, records: pd.DataFrame, table: list[Row]) -> dict[str, float]:
    """What learning did, beyond the numbers of the table."""
    learned = records.loc[records.kind == "learning"].dropna(axis=1, how="all")
    counts = learned.select_dtypes("number").columns
    return {
        f"{row['controller']}.learning.{row['behaviour']}.{count}": float(row[count])
        for row in learned.to_dict(orient="records")
        for count in counts
    }


def headline(outcome: Outcome) -> str:
    """From how many starts the robot reaches the lamp."""
    reached = {
        row["controller"]: f"{row['success_rate'] * row['episodes']:,.0f} of {row['episodes']:,} starts"
        for row in outcome.table
    }
    if "default" not in reached:
        return f"The robot reaches the lamp: {', '.join(f'`{name}` from {count}' for name, count in reached.items())}."
    others = [f"; `{name}` from {reached[name]}" for name in ("teacher", "paper") if name in reached]
    dim = outcome.config["vsa"]["dim"]
    return (
        f"One hypervector of {dim:,} numbers drives the robot to the lamp from {reached['default']} that it never "
        f"saw{''.join(others)}."
    )


def page(page: Page, outcome: Outcome, study: Study) -> None:
    """Fill the page with all that the run has something to show for."""
    from experiments.corral.page import fill  # with Matplotlib, without which the cells are measured

    fill(page, outcome)


study = Study(
    name="corral",
    about="Can one hypervector, learned from demonstrations, drive a robot as its teacher does?",
    settings=Corral,
    check=check,
    prepare=prepare,
    cells=cells,
    measure=measure,
    summarise=summarise,
    keys=("controller",),
    units=("kind", "episode"),
    metrics=metrics,
    table=tables.MAIN,
    headline=headline,
    page=page,
    presets=PRESETS,
    objective="default.success_rate",
)
