"""The registry of learning rules."""

from typing import Any

from behaviours.learning.base import Rule
from behaviours.learning.error_driven import ErrorDriven
from behaviours.learning.gradient import Gradient
from behaviours.learning.least_squares import LeastSquares
from behaviours.learning.one_shot import OneShot
from torchvsa.registry import Registry

RULES: Registry[type[Rule]] = Registry(
    "learning rule", {rule.name: rule for rule in (OneShot, ErrorDriven, LeastSquares, Gradient)}
)


def require_rule(rule: Any) -> Rule:
    """Return `rule` if it is a `Rule` object. Raises `TypeError`, saying what to write instead, for anything else."""
    if isinstance(rule, Rule):
        return rule
    if isinstance(rule, type) and issubclass(rule, Rule):
        raise TypeError(f"a rule is an object, not its class; write {rule.__name__}() for {rule.__name__}")
    if isinstance(rule, str) and rule in RULES:
        raise TypeError(f"a rule is an object, not its name; write {RULES.find(rule).__name__}() for {rule!r}")
    examples = ", ".join(f"{kind.__name__}()" for kind in RULES.values())
    raise TypeError(f"a rule is an object, such as {examples}; got {rule!r}")
