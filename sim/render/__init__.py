"""Pictures of rollouts: the corral from above, trajectories, and animations of several robots side by side.

`import sim` does not import this package, which needs matplotlib: write `from sim import render`.
"""

from sim.render.animation import animate, animate_steps, typical
from sim.render.pictures import COLOURS, INK, LAMPS, PAPER, WALL, draw_corral, draw_path, draw_rollout

__all__ = [
    "COLOURS",
    "INK",
    "LAMPS",
    "PAPER",
    "WALL",
    "animate",
    "animate_steps",
    "draw_corral",
    "draw_path",
    "draw_rollout",
    "typical",
]
