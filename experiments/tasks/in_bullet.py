"""Some of what drove in the fast engine drives again in the physics engine, from the same starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
import pandas as pd

import sim
from experiments.kit import Column, Row, Table
from experiments.kit.intervals import mean
from experiments.tasks import corral

D = TypeVar("D", bound=corral.Driving)
BODIES = {"planar": "bullet_starts", "wheeled": "wheeled_starts"}
"""The robot's bodies there, and the settings with the numbers of their starts."""
TWINS = {"bullet": "planar", "wheeled": "wheeled"}
"""What rows and engines that repeat others there are called, and the robot's body."""
EFFECTS = {"same": 0, "gained": 1, "lost": -1}
"""What the physics engine may make of a start: a success of what was none, or the reverse."""


@dataclass
class InBullet(corral.Driving):
    """From how many starts they do."""

    bullet_starts: int = corral.episodes(
        100, "the first starts, driven in the physics engine, too, where the study says so; 0: none", low=0
    )
    wheeled_starts: int = corral.episodes(50, "the same on the wheeled body", low=0)


def check(settings: InBullet, any_drive: bool = True) -> None:
    """Raise for an engine that is not installed, or does not have the body; `any_drive`: in the physics engine, too."""
    corral.check_driving(settings)
    if any_drive and counts(settings):
        try:
            corral.check_driving(settings, "bullet")
        except ValueError as error:
            raise ValueError(f"{error}; or leave it out: bullet_starts=0 wheeled_starts=0") from None


def counts(settings: InBullet) -> dict[str, int]:
    """Starts by body; nothing if all robots are in the physics engine as it is."""
    if settings.engine == "bullet":
        return {}
    return {body: count for body, name in BODIES.items() if (count := getattr(settings, name))}


def twin_starts(settings: Any, twin: str) -> int:
    """How many of the first starts drive again in the physics engine, for a name of `TWINS`."""
    return getattr(settings, BODIES[TWINS[twin]])


def there(settings: D, body: str) -> D:
    """The same settings in the physics engine, with this body."""
    return replace(settings, engine="bullet", body=body, robots=None)


def effects(
    settings: InBullet, policy: sim.ControllerLike, rollout: sim.Rollout, arena: str | sim.Arena = "default"
) -> dict[str, list[int]]:
    """Drive from the first starts of a rollout, with each body: what it makes of each of them, a value of `EFFECTS`."""
    found = {}
    for body, count in counts(settings).items():
        first = rollout.episode < count
        if first.any():
            driven = corral.drive(there(settings, body), policy, rollout.episode[first].tolist(), arena)
            found[body] = (driven.success.astype(int) - rollout.success[first]).tolist()
    return found


def counted(effects: Mapping[str, Sequence[int]]) -> Row:
    """How many starts had each effect: columns `{body}_{effect}` of a record."""
    return {f"{body}_{name}": each.count(value) for body, each in effects.items() for name, value in EFFECTS.items()}


def differences(records: pd.DataFrame) -> Row:
    """For each body `{body}_starts`, and success there less that in the run's engine with its interval.

    Records that count nothing are left out. The interval is a bootstrap over the starts.
    """
    row: Row = {}
    for body in BODIES:
        columns = [f"{body}_{name}" for name in EFFECTS]
        known = records.reindex(columns=columns).fillna(0).sum()
        each = np.repeat(list(EFFECTS.values()), known.to_numpy(dtype=int))
        row |= {f"{body}_starts": len(each) or None, **mean(f"{body}_minus_vector", each)}
    return row


def tables(keys: Sequence[Column], rows: Sequence[Row], about: str) -> list[Table]:
    """The rows that drove in the physics engine, one for each case; no table if there are none."""
    driven = [row for row in rows if any(row.get(f"{body}_starts") for body in BODIES)]
    columns = [*keys, Column("success_rate", "success in vector", ".3f")]
    for body in BODIES:
        columns += [
            Column(f"{body}_starts", f"{body} starts", ",d"),
            Column(
                f"{body}_minus_vector", f"{body} less vector", "+.3f",
                (f"{body}_minus_vector_low", f"{body}_minus_vector_high"),
            ),
        ]  # fmt: skip
    caption = (
        f"{about} A difference is success in the physics engine, with that body, less success in `vector`, from the "
        "same starts with the same wheel noise; its interval is a bootstrap over the starts."
    )
    return [Table("The same in the physics engine", columns, caption).show(driven)] if driven else []
