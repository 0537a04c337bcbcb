"""Why do programs that were trained apart disturb each other in a sum, and what repairs it?

Three behaviours of the corral robot are learned apart by each rule and added, beside one program that the same rule
learned from all demonstrations. The plain sum is explained by the scores of its programs, which add up, and trained
further on a few joint samples.

    torchvsa interference
    torchvsa interference rows=[mine,error_driven_5] '+learners.mine={name:error_driven,margin:8}'
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pandas as pd

from behaviours import Demonstrations, OneShot
from experiments.composition import interference_figures as figures
from experiments.composition import interference_tables as tables
from experiments.composition import sums
from experiments.composition.settings import Apart
from experiments.kit import Cell, Drawing, Part, Row, Study, grid, part, parts, setting
from experiments.tasks import corral

MARGINS = (0.0, 1.0, 2.0, 5.0, 10.0)
LEARNERS: dict[str, dict[str, Any]] = {
    "one_shot": {"name": "one_shot"},
    **{f"error_driven_{margin:g}": {"name": "error_driven", "margin": margin} for margin in MARGINS},
    "error_driven_evidence": {"name": "error_driven", "margin": 5.0, "evidence": 1.0},
    "gradient": {"name": "gradient", "epochs": 20},
    "least_squares": {"name": "least_squares"},
    "evident": {"name": "least_squares", "contradictions": "majority", "evidence": 0.05},
}
SLOW = ("gradient", "error_driven_10", "error_driven_evidence", "error_driven_5", "evident", "least_squares")
REPAIRS: dict[str, dict[str, Any]] = {
    "margin_5": {"name": "error_driven", "margin": 5.0},
    "margin_0": {"name": "error_driven", "margin": 0.0},
}


@dataclass
class Interference(Apart):
    """The settings of this study."""

    arena: Part = part("arena", "default", "where programs are asked; all learn in `default`")
    rule: Part = part("rule", "error_driven", "how the programs of the sum are learned that is explained and repaired")
    rows: list[str] = setting(list(LEARNERS), "learning rules, of those below", distinct=True)
    learners: dict[str, Any] = setting(LEARNERS, "options of a rule, by the name of a row")
    repairs: dict[str, Any] = setting(REPAIRS, "options of the rule that trains the sum further, by name")
    joint: list[int] = setting([0, 1, 2, 5, 10, 20, 50, 100], "joint samples to train the sum on", low=0, distinct=True)
    sources: list[str] = setting(
        list(sums.SOURCES), "where joint samples are drawn: anywhere, or where several behaviours know the condition",
        choices=sums.SOURCES, distinct=True,
    )  # fmt: skip
    draws: int = setting(3, "draws of the joint samples, for each draw of the codebooks", low=1)
    heldout: int = corral.episodes(200, "episodes of the teacher about which programs are asked")


def check(settings: Interference) -> None:
    """Raise for rules that cannot train programs of the architecture, and for ones that cannot go on from a sum."""
    corral.arena(settings.arena)
    corral.check_driving(settings)
    space = corral.check_learning(settings)
    for row in settings.rows:
        if row not in settings.learners:
            raise ValueError(f"rows: there is no {row!r}; choose from {', '.join(settings.learners)}")
        parts.refuse_unsupported(parts.rule(settings.learners[row], f"learners.{row}"), space)
    shown = Demonstrations([[0.0, 0.0, 0.0]], [[1.0, 1.0]])
    for name, options in settings.repairs.items():
        rule = parts.rule(options, f"repairs.{name}")
        try:
            rule.partial_fit(OneShot().fit(space, shown), shown)
        except ValueError as error:
            raise ValueError(f"repairs.{name}: {error}") from error


def cells(settings: Interference) -> list[Cell]:
    """A cell for each codebook and rule, each way to repair, and the explanation; the longest first."""
    codebooks, slow = range(settings.codebooks), [name for name in SLOW if name in settings.rows]
    found = grid(part=["rules"], learner=dict.fromkeys([*slow, *settings.rows]), codebook=codebooks)
    found += grid(part=["repair"], repair=settings.repairs, codebook=codebooks)
    return found + grid(part=["reason"], codebook=codebooks)


def measure(material: sums.Material, cell: Cell) -> list[Row]:
    """The rows of one part with one draw of the codebooks."""
    return MEASURED[cell["part"]](material, cell)


MEASURED = {"rules": sums.rules, "repair": sums.repair, "reason": sums.reason}


def metrics(settings: Interference, records: pd.DataFrame, table: list[Row]) -> dict[str, float]:
    """How exactly the scores of the programs add up to those of the sum, and how well they say what it answers."""
    own = records.loc[records.part == "reason"]
    lead = own.own + own.rival + own.bystander
    weights = own["count"].to_numpy()
    same = (own.predicted == own.right).to_numpy()
    return {
        "reason.largest_error": float((lead - own.lead).abs().max()),
        "reason.answers_predicted": float((same * weights).sum() / weights.sum()),
    }


METHOD = """
The teacher drives in the arena `default`; these runs are all that is shown. Three behaviours (seek light, avoid,
cruise) learn from the moments in which their own rules fire, each without the others, or silent in conditions that only
others know. Held-out moments are those of other runs, until the robot is at the lamp.

Scores are linear in the program: the lead of a result in a sum is the sum of its leads in each program. So the programs
alone say which moments the sum answers as the teacher does. A lead is given in units of the score that a stored pair
gives itself.

Joint samples are demonstrated moments with their commands, drawn at random from all demonstrations, or from those in
conditions that several behaviours know; fewer samples are the first of more. The sum is then trained further on them as
any behaviour is (`partial_fit`).

No behaviour can be right in all moments: the teacher's thresholds lie within bins, so that some conditions have two
commands. The best function of the bins is the ceiling.
"""
QUICK = {
    "rows": ["one_shot", "error_driven_5"],
    "joint": [0, 5, 50],
    "draws": 2,
    "codebooks": 2,
    "demonstrations": 20,
    "heldout": 20,
}

study = Study(
    name="interference",
    about="Why do programs trained apart disturb each other in a sum, and what repairs it?",
    settings=Interference,
    check=check,
    cells=cells,
    prepare=sums.prepare,
    measure=measure,
    summarise=tables.summarise,
    keys=("part", "learner", "how", "repair", "source", "joint", "knowers", "owner", "against"),
    metrics=metrics,
    tables=tables.shown,
    figures=[
        Drawing(
            "reason", figures.reason, "the lead of the right program against what the others add to it",
            "Each point is a moment with one draw of the codebooks, as large as it is frequent. The sum is right where "
            "both leads together are above 0, to the upper right of the line.",
        ),
        Drawing(
            "repair", figures.repair, "agreement against the number of joint samples",
            "The plain sum, trained further on joint samples. Lines: mean over codebooks and draws. Bands: lowest and "
            "highest mean of a codebook.",
        ),
        Drawing(
            "rules", figures.rules, "moments answered wrongly by rule, and who knows their conditions",
            "Wrong moments of programs learned apart and added, by who was shown the condition; a tick marks what the "
            "program learned jointly gets wrong.",
        ),
    ],
    headline=tables.headline,
    method=METHOD,
    presets={"quick": QUICK},
)  # fmt: skip
