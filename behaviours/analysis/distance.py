"""How much two behaviours differ, from their programs alone."""

import torch
from jaxtyping import Float64
from torch import Tensor

from behaviours.algebra import stack_programs
from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from torchvsa._numerics import cosines


def distance(a: Behaviour, b: Behaviour) -> float:
    """1 minus the cosine of two programs: 0 for the same direction, 1 for unrelated ones, 2 for opposite ones.

    The programs of behaviours that learned from similar readings are the farther apart, the more often the behaviours
    answer differently. No reading is asked. A zero program has distance 1 to every other.

    For 30 variants of the corral's teacher that were trained on readings spread over the ranges of the sensors, the
    rank correlation with disagreement is about .94. It falls to about .4 on the readings of its runs, many of which
    resemble each other: training gives the pairs near a threshold most of the weight. Programs of `OneShot`, which
    weights all pairs alike, keep .83 there (`torchvsa algebra`).

    Raises `ValueError` for behaviours over different spaces, whose programs are unrelated.
    """
    if not a.space.same_as(b.space):
        raise ValueError("behaviours over different spaces (other sensors, codes or seeds) have no distance")
    first, second = stack_programs([part.program.detach().cpu() for part in (a, b)])
    return 0.0 if torch.equal(first, second) else 1.0 - float(cosines(first, second))


def distances(bank: BehaviourBank) -> Float64[Tensor, "b b"]:
    """The `distance` between each two behaviours of a bank, in the order of its names; 0 on the diagonal.

    Raises `ValueError` for an empty bank.
    """
    if not len(bank):
        raise ValueError("this bank is empty, so that there are no distances")
    programs = stack_programs([bank[name].program.detach() for name in bank])
    found = 1.0 - cosines(programs[:, None], programs)
    return found.to(torch.float64).fill_diagonal_(0.0)
