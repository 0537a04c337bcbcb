"""Robot behaviours as hypervectors: learned from demonstrations, called with sensor readings, combined by addition."""

from typing import TYPE_CHECKING, Any

from behaviours.analysis import (
    Change,
    Explanation,
    Recognition,
    Rules,
    distance,
    distances,
    explain,
    explain_command,
    recognise,
    switching_weight,
    switching_weights,
)
from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.composition import (
    POLICIES,
    Blending,
    Bundle,
    Gated,
    Hierarchy,
    MotorSchema,
    Policy,
    Priority,
    Sequencing,
    Silence,
    Vote,
    WinnerTakesAll,
    choosing,
)
from behaviours.controller import Controller
from behaviours.demonstrations import Demonstrations
from behaviours.edges import quantile_edges
from behaviours.frozen import FrozenBehaviour
from behaviours.learning import RULES, ConvergenceWarning, ErrorDriven, Gradient, LeastSquares, OneShot, Rule
from behaviours.recall import Recall
from behaviours.report import LearningReport
from behaviours.schema import Actuator, Schema, Sensor
from behaviours.space import Space

if TYPE_CHECKING:
    from behaviours.estimators import BehaviourClassifier as BehaviourClassifier
    from behaviours.estimators import BehaviourRegressor as BehaviourRegressor

__all__ = [
    "POLICIES",
    "RULES",
    "Actuator",
    "Behaviour",
    "BehaviourBank",
    "Blending",
    "Bundle",
    "Change",
    "Controller",
    "ConvergenceWarning",
    "Demonstrations",
    "ErrorDriven",
    "Explanation",
    "FrozenBehaviour",
    "Gated",
    "Gradient",
    "Hierarchy",
    "LearningReport",
    "LeastSquares",
    "MotorSchema",
    "OneShot",
    "Policy",
    "Priority",
    "Recall",
    "Recognition",
    "Rule",
    "Rules",
    "Schema",
    "Sensor",
    "Sequencing",
    "Silence",
    "Space",
    "Vote",
    "WinnerTakesAll",
    "choosing",
    "distance",
    "distances",
    "explain",
    "explain_command",
    "quantile_edges",
    "recognise",
    "switching_weight",
    "switching_weights",
]


def __getattr__(name: str) -> Any:
    """Import the estimators on first access, since they alone need scikit-learn."""
    if name not in ("BehaviourClassifier", "BehaviourRegressor"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        from behaviours import estimators
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "sklearn":
            raise
        raise ImportError(f"{name} needs scikit-learn: pip install 'torchvsa[sklearn]'", name="sklearn") from error
    return getattr(estimators, name)
