"""Scikit-learn estimators: a classifier and a regressor, each of which is one hypervector.

This package and `behaviours.quantiles`, the base of both, need scikit-learn; `behaviours` imports them on first access.
"""

from behaviours.estimators.classifier import BehaviourClassifier
from behaviours.estimators.regressor import BehaviourRegressor

__all__ = ["BehaviourClassifier", "BehaviourRegressor"]
