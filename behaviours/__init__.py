"""Behaviours as hypervectors: learned from demonstrations, asked with readings, combined by adding them."""

from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.composition import POLICIES, Bundle, Policy, Priority
from behaviours.demonstrations import Demonstrations
from behaviours.learning import RULES, ErrorDriven, OneShot, Rule
from behaviours.recall import Recall
from behaviours.report import LearningReport
from behaviours.schema import Actuator, Schema, Sensor
from behaviours.space import Encoder, Space

__all__ = [
    "POLICIES",
    "RULES",
    "Actuator",
    "Behaviour",
    "BehaviourBank",
    "Bundle",
    "Demonstrations",
    "Encoder",
    "ErrorDriven",
    "LearningReport",
    "OneShot",
    "Policy",
    "Priority",
    "Recall",
    "Rule",
    "Schema",
    "Sensor",
    "Space",
]
