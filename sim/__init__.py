"""The corral: a simulated robot, its sensors, its teacher, and rollouts of any policy."""

import sim.quiet  # noqa: F401 (before anything that imports pybullet)
from sim.controller import Controller, Policy, as_controller, replay
from sim.corral import ARENAS, Arena, Start, draw_start
from sim.env import CorralEscapeEnv, CorralEscapeVectorEnv, register
from sim.result import Rollout, Steps, Summary
from sim.robot import ACTUATORS, BODIES, CONTROL_HZ
from sim.rollout import rollout
from sim.sensors import SENSORS
from sim.statistics import wilson
from sim.teacher import BEHAVIOURS, RULES, Teacher

__all__ = [
    "ACTUATORS",
    "ARENAS",
    "BEHAVIOURS",
    "BODIES",
    "CONTROL_HZ",
    "RULES",
    "SENSORS",
    "Arena",
    "Controller",
    "CorralEscapeEnv",
    "CorralEscapeVectorEnv",
    "Policy",
    "Rollout",
    "Start",
    "Steps",
    "Summary",
    "Teacher",
    "as_controller",
    "draw_start",
    "replay",
    "rollout",
    "wilson",
]

register()
