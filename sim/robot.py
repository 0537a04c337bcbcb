"""The robot: a round differential drive."""

from sim.channel import Channel

RADIUS = 0.15
"""Radius of the robot's outline, m."""
TRACK = 0.26
"""Distance between the wheels, m."""
MAX_SPEED = 0.4
"""Speed of a wheel at command 1, m/s."""
CONTROL_HZ = 20
"""Control steps per second."""
SUBSTEPS = 2
"""Steps of motion of the planar body per control step."""
TOUCH = 0.005
"""A robot touches a wall or a lamp if the gap between their outlines is at most this wide, m."""

BODIES = ("planar", "wheeled")
"""Bodies by name: an ideal one that is moved by its velocities, and one that stands on wheels, in `bullet` only."""

ACTUATORS = (
    Channel("left_motor", -1.0, 1.0, "fraction of full speed"),
    Channel("right_motor", -1.0, 1.0, "fraction of full speed"),
)
"""The commands, in order."""
