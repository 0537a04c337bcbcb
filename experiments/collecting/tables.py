"""The tables of what was gathered: what is missing, and what differs."""

from __future__ import annotations

from collections.abc import Iterable

from experiments.collecting.comparing import FEWEST, Comparison
from experiments.collecting.runs import Run
from experiments.kit import Column, Row, Table

MISSING = Table(
    "What is missing",
    [Column("run"), Column("state"), Column("why", "what is known")],
    "Runs without usable results; their rows are left out. The command of the sweep goes on with all of them; a "
    "damaged run begins anew with fresh=true.",
    words=True,
)
LONGEST = 5
"""How many missing cells are named per run."""
NOT_BEGUN = "the last sweep here asked for it: it has not begun, its settings were refused, or its folder is gone"


def missing(runs: Iterable[Run], not_begun: Iterable[str]) -> Table:
    """Runs without results, with cells that they lack, and runs that the same settings made twice."""
    rows: list[Row] = []
    first: dict[str, Run] = {}
    for run in runs:
        if run.state != "finished" or run.why:
            rows.append({"run": run.name, "state": run.state, "why": run.why + _named(run)})
        elif (twin := first.setdefault(run.same, run)) is not run:
            rows.append({"run": run.name, "state": "twice", "why": f"the same settings as {twin.name}; both are kept"})
    rows += [{"run": name, "state": "not begun", "why": NOT_BEGUN} for name in not_begun]
    return MISSING.show(rows)


def _named(run: Run) -> str:
    if not run.missing:
        return ""
    some = ["/".join(map(str, cell.values())) for cell in run.missing[:LONGEST]]
    more = len(run.missing) - len(some)
    return f"; missing: {', '.join(some)}" + (f" and {more} more" if more else "")


def settings(found: Comparison) -> Table:
    """The settings that differ."""
    a, b = found.labels
    return Table("What differs in settings", [Column("setting"), Column("a", a), Column("b", b)], words=True).show(
        found.settings
    )


def differences(found: Comparison) -> Table:
    """What differs in what was measured on the same cells or starts."""
    a, b = found.labels
    numbers = [
        Column("a", a, format=".4g"),
        Column("b", b, format=".4g"),
        Column("difference", "difference [95 %]", "+.3g", interval=("low", "high")),
        Column("common", about="cells or starts that both measured, and over which both means are taken"),
        Column("verdict", about=f"higher or lower where the interval excludes 0; {FEWEST} in common are needed"),
    ]
    scope = "these runs alone" if found.pairs < FEWEST else "these runs and others like them"
    caption = (
        f"{b} minus {a}, {_pairs(found.pairs)}, paired: each cell or start that both measured gives one difference. "
        f"The intervals are about {scope}. Of 20 differences that are due to chance, one is expected to be called "
        "higher or lower."
    )
    columns = [*(Column(name) for name in found.groups), Column("metric"), *numbers]
    return Table("What differs on what both measured", columns, caption).show(found.differences)


def metrics(found: Comparison) -> Table:
    """The metrics that differ, without intervals."""
    a, b = found.labels
    columns = [Column("metric"), Column("a", a, ".4g"), Column("b", b, ".4g"), Column("difference", format="+.3g")]
    caption = (
        "Each run's own metrics, over whatever it measured. Nothing is marked: they need not be of the same cells."
    )
    return Table("What differs in metrics", columns, caption).show(found.metrics)


def _pairs(count: int) -> str:
    return "two runs" if count == 1 else f"{count} pairs of runs that are alike in all other settings"
