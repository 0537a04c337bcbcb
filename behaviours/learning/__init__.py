"""Learning rules, by name."""

from behaviours.learning.base import Rule
from behaviours.learning.convergence import ConvergenceWarning, no_convergence_warnings
from behaviours.learning.error_driven import ErrorDriven
from behaviours.learning.gradient import Gradient
from behaviours.learning.least_squares import LeastSquares
from behaviours.learning.one_shot import OneShot
from behaviours.learning.registry import RULES, require_rule
from behaviours.report import LearningReport

__all__ = [
    "RULES",
    "ConvergenceWarning",
    "ErrorDriven",
    "Gradient",
    "LearningReport",
    "LeastSquares",
    "OneShot",
    "Rule",
    "no_convergence_warnings",
    "require_rule",
]
