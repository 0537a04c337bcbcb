"""Teachers: if-else rules that show a behaviour."""

from sim.teachers.escape import BEHAVIOURS, TEACHER_RULES, Teacher
from sim.teachers.flee_light import FleeLight
from sim.teachers.in_order import InOrder
from sim.teachers.wall_following import WallFollowing

__all__ = ["BEHAVIOURS", "TEACHER_RULES", "FleeLight", "InOrder", "Teacher", "WallFollowing"]
