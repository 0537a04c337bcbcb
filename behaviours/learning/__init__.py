"""Learning rules, by name."""

from behaviours.learning.base import Rule
from behaviours.learning.error_driven import ErrorDriven
from behaviours.learning.gradient import Gradient
from behaviours.learning.least_squares import LeastSquares
from behaviours.learning.one_shot import OneShot
from behaviours.report import LearningReport

RULES: dict[str, type[Rule]] = {rule.name: rule for rule in (OneShot, ErrorDriven, LeastSquares, Gradient)}

__all__ = ["RULES", "ErrorDriven", "Gradient", "LearningReport", "LeastSquares", "OneShot", "Rule"]
