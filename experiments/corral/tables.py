"""The tables of the page, and the numbers that they are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

import sim
from experiments.corral.failures import PLACES
from experiments.kit import Column, Outcome, Row, Table
from experiments.kit.columns import number

WHOLE = ("episodes", "common_episodes", "pairs_stored", "bins")
"""Numbers that are whole."""


def is_learner(row: Mapping[str, Any]) -> bool:
    """Whether a row competes; the teachers are what it is measured against."""
    return not row["controller"].startswith("teacher")


def agreement(key: str, label: str, about: str) -> Column:
    """A column of shares, of which the best learner's is marked."""
    return Column(key, label, ".3f", best="max", among=is_learner, about=about)


MAIN = Table(
    "Corral escape",
    [
        Column("controller"),
        Column(
            "episodes", "starts", about="held-out starts driven; none of them was demonstrated, and start by start all "
            "controllers meet the same ones, the first of them"
        ),
        Column(
            "success_rate", "success [95 %]", ".3f", ("success_low", "success_high"), bad=lambda rate: rate < 0.5,
            about="share of episodes in which the robot touches the lamp and stays for the dwell time, with Wilson's "
            "95 % interval",
        ),
        Column(
            "common_rate", "common", ".3f", best="max", among=is_learner,
            about="success on the starts that all controllers of this table drove, on which they can be compared",
        ),
        Column("escape_rate", "escape", about="share of episodes in which the robot leaves the corral at any time"),
        Column(
            "time_to_light_s", "time", ".1f", best="min", among=is_learner, alike="episodes",
            about="median time to the first touch of the lamp, s; a failed episode counts as longer than any other, so "
            "there is no median (-) where half of them fail",
        ),
        Column(
            "dwell_fraction", "dwell", about="of the control steps after first touching the lamp, the share spent at it"
        ),
        Column("collision_fraction", "collide", about="share of control steps in contact with a wall"),
        agreement(
            "train_agreement", "train",
            "agreement on the demonstrations, without the conditions that were shown with more than one command",
        ),
        agreement("heldout_agreement", "held out", "agreement on other runs of the teacher"),
        agreement(
            "unseen_agreement", "unseen",
            "agreement on the held-out samples whose condition was never demonstrated; - where there is none",
        ),
        Column(
            "pairs_stored", "pairs", ",.0f",
            about="pairs of condition and command in the program, repetitions included (nearest neighbour: samples "
            "kept)",
        ),
        Column(
            "bins", format=".0f", about="bins of equal width per sensor; - for controllers that see raw readings"
        ),
        Column(
            "query_us", "µs", ",.0f",
            about="median time of one answer for one robot, on the machine that ran this, with its workers busy",
        ),
    ],
    "Green: the best of its column, without the teachers, and only where all were measured on the same starts: success "
    "is compared in the column `common`, times only if all drove as many starts. Orange: less than half of the "
    "episodes succeed.",
)  # fmt: skip
AGREEMENT = (
    "Agreement: share of samples for which the controller commands what the teacher did. Left out everywhere: samples "
    "after the lamp was reached, since a robot at rest repeats one condition and would flatter every learner."
)
NUMBERS = (
    "episodes",
    *("success_rate", "success_low", "success_high"),
    *("common_episodes", "common_rate", "common_low", "common_high"),
    *("escape_rate", "time_to_light_s", "dwell_fraction", "collision_fraction"),
    *("train_agreement", "heldout_agreement", "unseen_agreement"),
    *("pairs_stored", "bins", "query_us"),
)
"""The numbers of a row, in order."""

EPISODE = {
    **dict.fromkeys(("controller", "body"), "object"),
    "episode": "int64",
    **dict.fromkeys(("success", "escaped"), "bool"),
    "time_to_light_s": "float64",
    "steps": "int64",
    **dict.fromkeys(("dwell_fraction", "collision_fraction", "start_x", "start_y", "start_heading"), "float64"),
    "end": "object",
    **dict.fromkeys(("steps_unlike_teacher", "behaviours_called"), "int64"),
}
"""The columns of an episode, and their types."""

AGREEMENTS = Table(
    "Agreement, counted in other ways",
    [
        Column("controller"),
        Column("heldout_agreement", "held out, per sample"),
        Column("heldout_agreement_distinct", "held out, per condition"),
        Column("unseen_share"),
        Column("train_agreement_all", "all demonstrated samples"),
    ],
    "Agreement, counted in other ways. Per condition: each distinct held-out condition counts once, however often it "
    "was met, at the bins of `default` for all. Unseen share: how many held-out samples have a condition that was "
    "never demonstrated. All demonstrated samples: contradictions included, in which no program can always be right.",
)
COUNTED = ("samples", "new", "re_added", "truly_known", "falsely_known", "contradicting")
COUNTS_OF_LEARNING = (*COUNTED, "epochs", "updates", "wrong", "presumed_known")
COUNTS = Table(
    "What the printed algorithm decided",
    [Column("controller"), *(Column(key, "re-added" if key == "re_added" else "") for key in COUNTED)],
    "What the algorithm decided about the demonstrated samples, in the order in which it met them. New: stored for "
    "the first time. Re-added: stored again, as the memory no longer resembled it. Truly known: skipped, and stored "
    "before. Falsely known: skipped although never stored. Contradicting: stored before with another command.",
)
CANDIDATES = Table(
    "Bins of paper_best_bins",
    [
        Column("bins", format=".0f"),
        Column("validation_success", "success on validation starts"),
        Column("train_agreement", "agreement on all demonstrated samples"),
    ],
    "How the bins of `paper_best_bins` were chosen.",
)
RULES = Table(
    "Agreement by the teacher's rule",
    [
        Column("controller"),
        *(
            Column(f"heldout_agreement.{rule}", rule.replace("_", " "), bad=lambda share: share < 0.5)
            for rule in sim.TEACHER_RULES
        ),
        Column("differs"),
        Column("ambiguous_share", "on the edge"),
    ],
    "Held-out agreement where each of the teacher's rules fires. Differs: share of held-out samples with another "
    "command than the teacher's. On the edge: of those, the share in bins in which the teacher itself gives several "
    "commands, since its threshold runs through the bin: no program that sees only bins can always be right there.",
)
ENDS = Table(
    "Failing episodes",
    [
        Column("controller"),
        Column("failed"),
        Column("of"),
        *(Column(place) for place in PLACES),
        Column("unlike_teacher", "steps unlike the teacher's"),
    ],
    "Failing episodes, and where the robot was when the time was up.",
)
MISTAKES = Table(
    "Commands in failing episodes that are not the teacher's",
    [
        Column("controller"),
        Column("rule", "where the teacher would", lambda row: row["rule"].replace("_", " ")),
        Column("command", "it commands"),
        Column("share", "share of steps"),
        Column("readings", "readings (m)"),
    ],
    "The commands that differ from the teacher's most often in the failing episodes: share of their control steps, and "
    "the median readings (left light, right light, distance) at which they were given.",
    words=True,
)
BODIES = Table(
    "Bodies",
    [
        Column("body"),
        Column("episodes"),
        Column("success_rate", "success [95 %]", ".3f", ("success_low", "success_high")),
    ],
)
SETTINGS = Table("What was run", [Column("setting"), Column("value")], words=True)


def by_controller(records: pd.DataFrame) -> dict[str, Row]:
    """The numbers that were measured of each controller, without those that do not apply to it."""
    found = {}
    for row in records.loc[records.kind == "controller"].to_dict(orient="records"):
        known = {
            str(key): value for key, value in row.items() if not pd.isna(value) and key not in ("kind", "controller")
        }
        found[row["controller"]] = known | {key: int(known[key]) for key in WHOLE if key in known}
    return found


def learning(records: pd.DataFrame) -> list[Row]:
    """What a learning rule did, for each behaviour of each controller."""
    rows = records.loc[records.kind == "learning"].reindex(columns=["controller", "behaviour", *COUNTS_OF_LEARNING])
    return rows.astype(dict.fromkeys(COUNTS_OF_LEARNING, int)).to_dict(orient="records")


def episodes_of(records: pd.DataFrame) -> pd.DataFrame:
    """The driven episodes, with the types that a frame with other rows in it loses."""
    return records.loc[records.kind == "episode", list(EPISODE)].astype(EPISODE)


def shared_success(episodes: pd.DataFrame, names: Sequence[str]) -> dict[str, pd.Series]:
    """The success of each of these controllers on the starts that all of them drove."""
    chosen = {name: episodes.loc[episodes.controller == name].set_index("episode").success for name in names}
    shared = set.intersection(*(set(success.index) for success in chosen.values()))
    return {name: success[success.index.isin(shared)] for name, success in chosen.items()}


def failing(episodes: pd.DataFrame, names: Sequence[str]) -> list[Row]:
    """For each controller, how many episodes failed, where their robots ended, and the steps unlike the teacher's."""
    rows = []
    for name in names:
        driven = episodes.loc[episodes.controller == name]
        failed = driven.loc[~driven.success]
        wrong = failed.steps_unlike_teacher.sum() / failed.steps.sum() if len(failed) else None
        ends = {place: int((failed.end == place).sum()) for place in PLACES}
        rows.append({"controller": name, "failed": len(failed), "of": len(driven), **ends, "unlike_teacher": wrong})
    return rows


def most_frequent_mistakes(records: pd.DataFrame, names: Sequence[str], most: int = 3) -> list[Row]:
    """The most frequent differences of each controller that fails."""
    rows = records.loc[(records.kind == "mistake") & records.controller.isin(names)].groupby("controller").head(most)
    return [
        {**row, "readings": ", ".join(f"{row[sensor.name]:.2f}" for sensor in sim.SENSORS)}
        for name in names
        for row in rows.loc[rows.controller == name].to_dict(orient="records")
    ]


def settings(outcome: Outcome) -> list[Row]:
    """The settings that matter, in words."""
    config = outcome.config
    encoder, printed, vsa = config["encoder"], config["paper"], config["vsa"]
    readings = f"{encoder['bins']} bins per sensor, " if "bins" in encoder else ""
    rule = ", ".join(f"{key} {value}" for key, value in config["rule"].items() if key != "name")
    rows = {
        "architecture": f"{vsa['name']}, d = {vsa['dim']:,}, {vsa['dtype']}",
        "default: readings": f"{readings}{encoder['name']} codes, joined by {config['record']['name']}",
        "default: protection": config["protection"]["name"],
        "default: learning rule": f"{config['rule']['name']} ({rule})",
        "paper: readings": f"the same bins, {printed['encoder']['name']} codes, joined by {printed['record']['name']}, "
        f"protection {printed['protection']['name']}",
        "bundled: combination": config["composition"]["name"],
        "arena and body": f"{config['arena']['name']}, {config['body']}",
        "starts": f"{config['starts']:,} held out for teacher, default and bundled; {config['other_starts']:,} for "
        "others",
        "seed": number(config["seed"]),
    }
    return [{"setting": name, "value": value} for name, value in rows.items()]
