"""The corral-escape task: a simulated robot with sensors, teachers, and rollouts of any controller."""

from sim.arena import Arena, Start, draw_start, walls
from sim.arenas import ARENAS, find_arena
from sim.arenas.corral import corral
from sim.channel import Channel
from sim.controller import Controller, ControllerLike, as_controller, replay
from sim.engines import NAMES as ENGINES
from sim.env import CorralEscapeEnv, register
from sim.result import Rollout, Steps, Summary
from sim.robot import ACTUATORS, BODIES, CONTROL_HZ
from sim.rollout import rollout
from sim.shapes import Box, Lamp, Pillar
from sim.statistics import wilson
from sim.task import SENSORS, Task
from sim.teachers import BEHAVIOURS, TEACHER_RULES, FleeLight, InOrder, Teacher, WallFollowing
from sim.vector_env import CorralEscapeVectorEnv

__all__ = [
    "ACTUATORS",
    "ARENAS",
    "BEHAVIOURS",
    "BODIES",
    "CONTROL_HZ",
    "ENGINES",
    "SENSORS",
    "TEACHER_RULES",
    "Arena",
    "Box",
    "Channel",
    "Controller",
    "ControllerLike",
    "CorralEscapeEnv",
    "CorralEscapeVectorEnv",
    "FleeLight",
    "InOrder",
    "Lamp",
    "Pillar",
    "Rollout",
    "Start",
    "Steps",
    "Summary",
    "Task",
    "Teacher",
    "WallFollowing",
    "as_controller",
    "corral",
    "draw_start",
    "find_arena",
    "replay",
    "rollout",
    "walls",
    "wilson",
]

register()
