"""The corral-escape task: a simulated robot with sensors, a teacher, and rollouts of any controller."""

from sim.channel import Channel
from sim.controller import Controller, ControllerLike, as_controller, replay
from sim.corral import ARENAS, Arena, Start, draw_start
from sim.env import CorralEscapeEnv, CorralEscapeVectorEnv, register
from sim.result import Rollout, Steps, Summary
from sim.robot import ACTUATORS, BODIES, CONTROL_HZ
from sim.rollout import rollout
from sim.sensors import SENSORS
from sim.statistics import wilson
from sim.teacher import BEHAVIOURS, TEACHER_RULES, Teacher

__all__ = [
    "ACTUATORS",
    "ARENAS",
    "BEHAVIOURS",
    "BODIES",
    "CONTROL_HZ",
    "SENSORS",
    "TEACHER_RULES",
    "Arena",
    "Channel",
    "Controller",
    "ControllerLike",
    "CorralEscapeEnv",
    "CorralEscapeVectorEnv",
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
