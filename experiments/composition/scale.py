"""How many behaviours fit into one vector, and what their contradictions cost.

Plain functions that return numbers. A behaviour has 20 random conditions of 3 sensors of 16 values each, lookup codes
joined by a product, and random results out of 9 independent ones. All behaviours of a bank are in one vector: their
plain sum (bundled), or each bound to a context (gated).

There are 16³ = 4,096 conditions, so that only banks of up to 128 behaviours (2,560 pairs) can be free of
contradictions. They are drawn so: no condition is in two behaviours of the first 128, nor in two of the last 128. In a
bank of 256 behaviours, conditions are shared by both halves, most of them with different results.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64, Shaped
from torch import Tensor

from behaviours import Actuator, Schema, Sensor, Space
from experiments.kit import Column, Table
from torchvsa import architecture, recall_probability
from torchvsa.encoders import Lookup, Product

VALUES, SENSORS, RESULTS, PAIRS = 16, 3, 9, 20
DIMS = (1000, 4000, 16_000, 64_000)
SIZES = (1, 2, 4, 8, 16, 32, 64, 128, 256)
"""Numbers of behaviours; they divide the last one."""
DISTINCT = 128
"""Behaviours among which no condition is shared."""
CODEBOOKS = range(5)
"""5 x 256 x 20 = 25,600 queries per point."""
MARGIN = 5.0
"""In units of a stored pair, as in `ErrorDriven`."""
POOL = 60
"""Conditions from which all behaviours of a contradicting bank draw theirs."""


@dataclass(frozen=True)
class Shown:
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
    def of(cls, dim: int, codebook: int, cells: Int64[Tensor, "b k n"], results: Int64[Tensor, "b k"]) -> Shown:
        """Encode pairs with the codebooks of a seed."""
        made = space(dim, codebook)
        conditions = torch.stack([made.encode(column) for column in cells.unbind(1)])
        return cls(cells, results, conditions, made.items(torch.arange(RESULTS)[:, None]).to(torch.float32))


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


def one_shot(shown: Shown) -> Float[Tensor, "b d"]:
    """The programs of `OneShot`: the sum of all pairs. Whole numbers in float32, exact up to 2^24."""
    programs = torch.zeros(shown.conditions.shape[1:])
    for number, conditions in enumerate(shown.conditions):
        programs += conditions * shown.items[shown.results[:, number]]
    return programs


def trained(shown: Shown, margin: float = MARGIN, epochs: int = 200) -> Float[Tensor, "b d"]:
    """The programs of `ErrorDriven(margin)`, all behaviours trained at once."""
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


def scores(shown: Shown, asked: Float[Tensor, "b d"]) -> Float[Tensor, "b k r"]:
    """The scores of all results for each behaviour's conditions, asked of one vector per behaviour."""
    return torch.stack([(asked * conditions) @ shown.items.T for conditions in shown.conditions], 1)


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


def capacity(dim: int, codebooks: Iterable[int] = CODEBOOKS, sizes: Sequence[int] = SIZES) -> list[dict[str, float]]:
    """Recall and its prediction for banks of several sizes: one row per size.

    Columns: `one_shot` and `trained`, each `.bundled`, `.gated` and `.predicted`. One-shot recall is predicted by
    `recall_probability("MAP-I", d, 20 b, 9)`, trained by `predicted`.
    """
    count, found = max(sizes), []
    for codebook in codebooks:
        shown = Shown.of(dim, codebook, *behaviours(count, codebook))
        contexts = contexts_for(count, dim, codebook)
        made = {"one_shot": one_shot(shown), "trained": trained(shown)}
        own, squares = scores(shown, made["trained"]), made["trained"].double().square().sum(1)
        for size in sizes:
            row: dict[str, float] = {"dim": dim, "behaviours": size, "queries": count * PAIRS}
            for name, programs in made.items():
                row[f"{name}.bundled"] = recall(scores(shown, together(programs, size)), shown.results)
                row[f"{name}.gated"] = recall(scores(shown, together(programs, size, contexts)), shown.results)
            row["one_shot.predicted"] = recall_probability("MAP-I", dim, PAIRS * size, RESULTS)
            row["trained.predicted"] = predicted(own, shown.results, squares, size)
            found.append(row)
    return [_mean([row for row in found if row["behaviours"] == size]) for size in sizes]


def contradictions(
    dim: int = 4000, codebooks: Iterable[int] = range(20), sizes: Sequence[int] = (2, 3, 8), queries: int = 20_000
) -> list[dict[str, float]]:
    """Recall of behaviours that contradict each other over 60 shared conditions, beside a count of votes.

    Asked is each behaviour's own result. Counting votes predicts that the result of most behaviours wins, ties at
    random.
    """
    codebooks, rows = list(codebooks), []
    for size in sizes:
        banks = -(-queries // (len(codebooks) * size * PAIRS))
        found = []
        for codebook in codebooks:
            drawn = [contradicting(size, codebook * banks + bank) for bank in range(banks)]
            cells, results = (torch.cat(part) for part in zip(*drawn, strict=True))
            shown = Shown.of(dim, codebook, cells, results)
            contexts = contexts_for(len(cells), dim, codebook)
            row: dict[str, float] = {"dim": dim, "behaviours": size, "queries": len(cells) * PAIRS}
            row["votes"] = sum(votes(*bank) for bank in drawn) / banks
            for name, programs in (("one_shot", one_shot(shown)), ("trained", trained(shown))):
                row[f"{name}.bundled"] = recall(scores(shown, together(programs, size)), results)
                row[f"{name}.gated"] = recall(scores(shown, together(programs, size, contexts)), results)
            found.append(row)
        rows.append(_mean(found))
    return rows


def votes(cells: Int64[Tensor, "b k n"], results: Int64[Tensor, "b k"]) -> float:
    """The expected share of pairs whose result wins a count of votes, ties at random."""
    condition = cells.flatten(0, 1).unique(dim=0, return_inverse=True)[1]
    result = results.flatten()
    counts = torch.zeros(int(condition.max()) + 1, RESULTS, dtype=torch.int64)
    counts.index_put_((condition, result), torch.ones_like(result), accumulate=True)
    wins = counts == counts.amax(1, keepdim=True)
    return float((wins.double() / wins.sum(1, keepdim=True))[condition, result].mean())


def misses(rows: Sequence[dict[str, float]], most: int = DISTINCT) -> dict[str, float]:
    """The largest difference between recall and its prediction, for banks of up to `most` behaviours."""
    return {
        f"{rule}.{how}": max(
            abs(row[f"{rule}.{how}"] - row[f"{rule}.predicted"]) for row in rows if row["behaviours"] <= most
        )
        for rule in ("one_shot", "trained")
        for how in ("bundled", "gated")
    }


def table(rows: Sequence[dict[str, float]]) -> str:
    """The rows of `capacity` or `contradictions` as a Markdown table."""
    columns = [Column(name, name, ".3f" if "." in name or name == "votes" else ".0f") for name in rows[0]]
    return Table("Recall", columns).show(rows).markdown()


def _mean(rows: Sequence[dict[str, float]]) -> dict[str, float]:
    """The mean of each column over codebooks; queries are added."""
    mean = {name: sum(row[name] for row in rows) / len(rows) for name in rows[0]}
    return mean | {"queries": sum(row["queries"] for row in rows)}
