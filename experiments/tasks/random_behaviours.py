"""Random behaviours: 20 random conditions each with random results, and what a bank of them recalls from one vector.

A condition is a reading of 3 sensors of 16 values, lookup codes joined by a product; results are 9 independent ones.
All behaviours of a bank are in one vector: their plain sum (bundled), or each bound to a context (gated).

There are 16³ = 4,096 conditions, so that only banks of up to 128 behaviours (2,560 pairs) can be free of
contradictions. They are drawn so: no condition is in two behaviours of the first 128, nor in two of the last 128. In a
bank of 256 behaviours, conditions are shared by both halves, most of them with different results.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64, Shaped
from torch import Tensor

from behaviours import Actuator, Schema, Sensor, Space
from torchvsa import architecture
from torchvsa.encoders import Lookup, Product

VALUES, SENSORS, RESULTS, PAIRS = 16, 3, 9, 20
DISTINCT = 128
"""Behaviours among which no condition is shared."""
MARGIN = 5.0
"""In units of a stored pair, as in `ErrorDriven`."""
CACHED = 500_000
"""Elements of programs that are trained side by side; 2 MB."""
POOL = 60
"""Conditions from which all behaviours of a contradicting bank draw theirs."""


@dataclass(frozen=True)
class EncodedPairs:
    """The pairs of several behaviours, encoded.

    Attributes:
        cells: `[b, k, 3]`, the values of the sensors.
        results: `[b, k]`.
        conditions: `[k, b, d]`, int8.
        items: `[9, d]`, float32.
    """

    cells: Int64[Tensor, "b k n"]
    results: Int64[Tensor, "b k"]
    conditions: Shaped[Tensor, "k b d"]
    items: Float[Tensor, "r d"]

    @classmethod
    def of(cls, dim: int, codebook: int, cells: Int64[Tensor, "b k n"], results: Int64[Tensor, "b k"]) -> EncodedPairs:
        """Encode pairs with the codebooks of a seed."""
        made = space(dim, codebook)
        conditions = torch.stack([made.encode(column) for column in cells.unbind(1)])
        return cls(cells, results, conditions, made.items(torch.arange(RESULTS)[:, None]).to(torch.float32))

    def some(self, chosen: slice) -> EncodedPairs:
        """The pairs of some of the behaviours."""
        return EncodedPairs(self.cells[chosen], self.results[chosen], self.conditions[:, chosen], self.items)


def space(dim: int, codebook: int) -> Space:
    """Lookup codes of integers, joined by a product, and 9 independent results."""
    vsa = architecture("MAP-I", dim, "int8")
    schema = Schema(
        [Sensor(name, 0, VALUES) for name in ("left", "right", "front")],
        [Actuator("result", 0, RESULTS - 1, levels=RESULTS)],
    )
    codes = Lookup(vsa, RESULTS)
    return Space(schema, Product(Lookup(vsa, VALUES), SENSORS), seed=codebook, command_codes=codes)


def behaviours(count: int, seed: int) -> tuple[Int64[Tensor, "b k n"], Int64[Tensor, "b k"]]:
    """Cells and results of behaviours; no condition is in two of the same `DISTINCT` ones."""
    rng = np.random.default_rng([seed, 0])
    halves = [rng.permutation(VALUES**SENSORS)[: DISTINCT * PAIRS] for _ in range(-(-count // DISTINCT))]
    chosen = np.concatenate(halves).reshape(-1, PAIRS)[:count]
    return _cells(chosen), torch.from_numpy(rng.integers(0, RESULTS, chosen.shape))


def contradicting(count: int, seed: int) -> tuple[Int64[Tensor, "b k n"], Int64[Tensor, "b k"]]:
    """Cells and results of behaviours that all draw their conditions from the same `POOL`."""
    rng = np.random.default_rng([seed, 1])
    pool = rng.permutation(VALUES**SENSORS)[:POOL]
    chosen = np.stack([rng.permutation(pool)[:PAIRS] for _ in range(count)])
    return _cells(chosen), torch.from_numpy(rng.integers(0, RESULTS, chosen.shape))


def _cells(numbers: np.ndarray[tuple[int, ...], np.dtype[np.int64]]) -> Int64[Tensor, "b k n"]:
    return torch.from_numpy(np.stack(np.unravel_index(numbers, (VALUES,) * SENSORS), -1))


def one_shot(shown: EncodedPairs) -> Float[Tensor, "b d"]:
    """The programs of `OneShot`: the sum of all pairs. Whole numbers in float32, exact up to 2^24."""
    programs = torch.zeros(shown.conditions.shape[1:])
    for number, conditions in enumerate(shown.conditions):
        programs += conditions * shown.items[shown.results[:, number]]
    return programs


def trained(shown: EncodedPairs, margin: float = MARGIN, epochs: int = 200) -> Float[Tensor, "b d"]:
    """The programs of `ErrorDriven(margin)`, several behaviours trained at once: as many as fit into a cache."""
    count, size = len(shown.cells), max(1, CACHED // shown.items.shape[1])
    return torch.cat(
        [_trained(shown.some(slice(first, first + size)), margin, epochs) for first in range(0, count, size)]
    )


def _trained(shown: EncodedPairs, margin: float, epochs: int) -> Float[Tensor, "b d"]:
    dim = shown.items.shape[1]
    programs = torch.zeros(shown.conditions.shape[1:])
    rows = torch.arange(len(programs))
    # A program knows only the results that it was shown.
    unknown = torch.ones(len(programs), RESULTS, dtype=torch.bool).scatter(1, shown.results, False)
    for _ in range(epochs):
        corrected = 0
        for number, conditions in enumerate(shown.conditions):
            target = shown.results[:, number]
            scores = ((programs * conditions) @ shown.items.T).masked_fill(unknown, -torch.inf)
            others = scores.clone()
            others[rows, target] = -torch.inf
            rival_score, rival = others.max(1)
            lead = scores[rows, target] - rival_score.clamp(min=0)
            short = ((lead < margin * dim) | (lead <= 0)).nonzero()[:, 0]
            change = shown.items[target[short]]
            change = change - shown.items[rival[short]] * (rival_score[short] > 0)[:, None]
            programs[short] += conditions[short] * change
            corrected += len(short)
        if not corrected:
            break
    return programs


def scores(shown: EncodedPairs, asked: Float[Tensor, "b d"]) -> Float[Tensor, "b k r"]:
    """The scores of all results for each behaviour's conditions, asked of one vector per behaviour."""
    each = zip(shown.conditions.unbind(1), asked, strict=True)
    return torch.stack([conditions.to(torch.float32) @ (vector * shown.items).T for conditions, vector in each])


def together(
    programs: Float[Tensor, "b d"], size: int, contexts: Shaped[Tensor, "b d"] | None = None
) -> Float[Tensor, "b d"]:
    """What is asked for each behaviour if each `size` of them are in one vector: bundled, or gated by `contexts`."""
    bound = programs if contexts is None else programs * contexts
    vectors = bound.view(-1, size, bound.shape[1]).sum(1).repeat_interleave(size, 0)
    return vectors if contexts is None else vectors * contexts


def recall(found: Float[Tensor, "b k r"], results: Int64[Tensor, "b k"]) -> float:
    """The share of queries whose result scores highest."""
    return float((found.argmax(-1) == results).double().mean())


def contexts_for(count: int, dim: int, codebook: int) -> Shaped[Tensor, "b d"]:
    """Random contexts, unrelated to the codebooks of the same number."""
    generator = torch.Generator().manual_seed(1_000_000 + codebook)
    return architecture("MAP-I", dim, "int8").random(count, generator=generator)


def predicted(
    own: Float[Tensor, "b k r"], results: Int64[Tensor, "b k"], squares: Float64[Tensor, "b"], size: int
) -> float:
    """The expected recall in banks of `size`, from what is known of each program alone.

    To the scores of a program the other ones add normal noise, for each result of variance Σ|pⱼ|² over the others. The
    right result then wins with ∫ φ(x) · Π Φ(x + (s_right - s_other) / σ) dx, by Gauss-Hermite quadrature.

    Args:
        own: The scores that each program gives alone.
        results: The right results.
        squares: |pⱼ|².
        size: The number of behaviours in a vector.
    """
    if size == 1:
        return recall(own, results)
    groups = squares.view(-1, size)
    deviation = (groups.sum(1, keepdim=True) - groups).flatten().sqrt()
    right = own.gather(-1, results[..., None])
    leads = ((right - own).double() / deviation[:, None, None]).scatter(-1, results[..., None], torch.inf)
    points, weights = np.polynomial.hermite_e.hermegauss(40)
    chance = torch.zeros(results.shape, dtype=torch.float64)
    for point, weight in zip(points, weights, strict=True):
        chance += weight * torch.special.ndtr(leads + point).prod(-1)
    return float(chance.mean()) / float(weights.sum())


def votes(cells: Int64[Tensor, "b k n"], results: Int64[Tensor, "b k"]) -> float:
    """The expected share of pairs whose result wins a count of votes, ties at random."""
    condition = cells.flatten(0, 1).unique(dim=0, return_inverse=True)[1]
    result = results.flatten()
    counts = torch.zeros(int(condition.max()) + 1, RESULTS, dtype=torch.int64)
    counts.index_put_((condition, result), torch.ones_like(result), accumulate=True)
    wins = counts == counts.amax(1, keepdim=True)
    return float((wins.double() / wins.sum(1, keepdim=True))[condition, result].mean())
