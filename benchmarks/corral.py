"""What the benchmarks of learning and recall share: the teacher's runs in the corral, and the paper's codebooks."""

from functools import cache

import torch
from torch import Tensor

import sim
from behaviours import Demonstrations, Space
from experiments.tasks.corral import schema
from torchvsa import MAP, SelfShift
from torchvsa.encoders import Lookup, Sum


@cache
def samples(count: int) -> Demonstrations:
    """The first control steps of the teacher's runs."""
    episodes = range(max(2, count // 220))
    steps = sim.rollout(sim.Teacher(), episodes=episodes, record=True).trajectory
    if len(steps.sensors) < count:
        raise ValueError(f"{len(episodes)} episodes have {len(steps.sensors)} steps; {count} are needed")
    return Demonstrations(steps.sensors[:count], steps.commands[:count])


def space(dim: int, device: str) -> Space:
    """The paper's: 32 lookup codes, bundled, behind the self-derived shift with the mean width."""
    vsa = MAP(dim, dtype=torch.int8)
    robot = schema()
    return Space(robot, Sum(Lookup(vsa, 32), len(robot.sensors)), protection=SelfShift(vsa)).to(device)


def different(space: Space, rows: int, generator: torch.Generator) -> Tensor:
    """Readings in the middle of bins, no two rows in the same."""
    sensors, bins = space.schema.sensors, space.encoder.bins
    cells = torch.randperm(bins ** len(sensors), generator=generator)[:rows]
    low, high = (torch.tensor([getattr(s, end) for s in sensors], dtype=torch.float64) for end in ("low", "high"))
    chosen = cells[:, None] // bins ** torch.arange(len(sensors)) % bins
    return low + (chosen + 0.5) / bins * (high - low)
