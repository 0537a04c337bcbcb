"""Scikit-learn estimators: a classifier and a regressor, each of which is one hypervector.

It needs scikit-learn; `behaviours` imports it on first access.
"""

from behaviours.estimators.classifier import BehaviourClassifier
from behaviours.estimators.regressor import BehaviourRegressor

__all__ = ["BehaviourClassifier", "BehaviourRegressor"]
