"""Policies that combine the behaviours of a bank, and their registry."""

from collections.abc import Callable

from behaviours.composition.base import Policy
from behaviours.composition.blending import Blending
from behaviours.composition.bundle import Bundle
from behaviours.composition.gated import Gated
from behaviours.composition.motor_schema import MotorSchema
from behaviours.composition.priority import Priority
from behaviours.composition.silence import Silence
from behaviours.composition.vote import Vote
from behaviours.composition.winner_takes_all import WinnerTakesAll
from torchvsa.registry import Registry

POLICIES: Registry[Callable[..., Policy]] = Registry(
    "policy",
    {
        "bundle": Bundle,
        "priority": Priority,
        "winner_takes_all": WinnerTakesAll,
        "blending": Blending,
        "motor_schema": MotorSchema,
        "vote": Vote,
        "gated": Gated,
    },
)
"""Policies by name; each is called with a bank and its options."""

__all__ = [
    "POLICIES",
    "Blending",
    "Bundle",
    "Gated",
    "MotorSchema",
    "Policy",
    "Priority",
    "Silence",
    "Vote",
    "WinnerTakesAll",
]
