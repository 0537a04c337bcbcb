"""Where the weighted sum of two behaviours changes over from one to the other."""

from typing import Any

import torch
from jaxtyping import Float64, Shaped
from torch import Tensor

from behaviours.algebra import stack_programs
from behaviours.behaviour import Behaviour
from behaviours.memory import require_levels
from behaviours.ordered import distinct_rows
from behaviours.space import check_addable
from torchvsa import Readout
from torchvsa._blocks import by_blocks


def switching_weights(a: Behaviour, b: Behaviour, readings: Any) -> Float64[Tensor, "batch"]:
    """For each reading `[B, n]`, the weight w in [0, 1] at which `(1 - w) * a + w * b` stops answering as `a` does.

    Scores of a sum are sums of scores. The answer r of `a` therefore holds until w has brought the lead of r over
    another result, `(1 - w) · lead_a + w · lead_b`, down to 0. Nothing is sampled: w is the least such weight over all
    results of both, exact up to rounding.

    inf where no weight changes the answer, for example because both answer alike; NaN where no sensor was observed. 0
    where a result that only `b` has scores higher in `a` than its own answer (a larger weight may restore the answer).

    Raises `ValueError` for behaviours that do not add up (other codes, other sensors), and for invalid readings.
    """
    check_addable([a.space, b.space])
    require_levels("switching_weights", [a, b])
    space = a.space
    results, _ = distinct_rows(torch.cat([a.results, b.results.to(a.results.device)]))
    programs = stack_programs([part.program.detach().to(space.device) for part in (a, b)])
    readout = space.vsa.readout(programs, space.items(results))
    cells = space.cells(readings)

    def weights(rows: Shaped[Tensor, "rows w"]) -> Float64[Tensor, "rows"]:
        return _first_switch(readout, len(a.results), space.encode(rows))

    found = by_blocks(weights, cells, row_bytes=8 * space.vsa.dim)
    return found.masked_fill((cells < 0).all(-1), torch.nan)


def switching_weight(a: Behaviour, b: Behaviour, readings: Any) -> float:
    """The weight w at which `(1 - w) * a + w * b` has left `a` in half of the readings `[B, n]` where they disagree.

    The median of `switching_weights` over those readings, the lower one of an even number. NaN if `a` and `b` agree on
    all readings. Raises `ValueError` as `switching_weights` does.
    """
    weights = switching_weights(a, b, readings)
    disagree = (a(readings).commands != b(readings).commands.to(a.space.device)).any(-1) & ~weights.isnan()
    chosen = weights[disagree].sort().values
    return float(chosen[(len(chosen) - 1) // 2]) if len(chosen) else float("nan")


def _first_switch(readout: Readout, own: int, conditions: Shaped[Tensor, "rows d"]) -> Float64[Tensor, "rows"]:
    """The least weight at which one of the results overtakes the answer of `a`, whose `own` results come first."""
    scores = readout(conditions)
    answer = scores[:, 0, :own].argmax(-1)[:, None, None].expand(-1, 2, 1)
    of_a, of_b = (scores.gather(-1, answer) - scores).unbind(1)
    weights = torch.where(of_b < 0, of_a / torch.where(of_b < 0, of_a - of_b, 1.0), torch.inf)
    return torch.where(of_a < 0, 0.0, weights).amin(-1)
