"""The closed forms: mean and deviation of the right item's score, for each architecture.

A noisy vector y is compared with items by their cosines. Times √d, those of other items are standard normal for large
d, whatever y is. That of the right item x has the mean √d · E[yx] / √(E[y²] · E[x²]) and, to first order, the deviation

    mean · √Var(yx / E[yx] - y² / 2E[y²] - x² / 2E[x²])

of one element, since the lengths of y and x vary together with their product. docs/capacity.md derives each form.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import torch

Atoms = Literal["bipolar", "uniform"]


@dataclass(frozen=True)
class Stored:
    """What one hypervector holds.

    Attributes:
        count: Number k of pairs, or of members of a bundle.
        bound: Whether they are pairs, which are unbound before they are compared.
        raw: Whether the sum is left as it is, instead of being normalised once.
        atoms: How the elements of random hypervectors of MAP-C are distributed.
    """

    count: int
    bound: bool = True
    raw: bool = False
    atoms: Atoms = "bipolar"


class Score(NamedTuple):
    """The right item's score: its mean per √(d - lost), and its deviation, in units of the others' deviation."""

    signal: float
    spread: float
    lost: int = 0


def _sum(stored: Stored) -> Score:
    k = stored.count
    return Score(1 / math.sqrt(k), math.sqrt(max((k - 1) * (k - 1.5), 0.0)) / k)


def _majority(stored: Stored) -> Score:
    if stored.raw:
        return _sum(stored)
    voters = stored.count + (stored.count + 1) % 2  # one more summand decides ties
    q = _binomial(voters - 1, (voters - 1) // 2)
    return Score(q, math.sqrt(max(1 - q * q, 0.0)))


def _clipped(stored: Stored) -> Score:
    if stored.atoms == "uniform":
        return _uniform(stored)
    if stored.raw:
        return _sum(stored)
    k = stored.count
    # A summand decides an element if the other k - 1 are tied. A tie of all k leaves a 0.
    q = _binomial(k - 1, k // 2)
    power = 1 - (_binomial(k, k // 2) if k % 2 == 0 else 0.0)
    variance = 1 - q * q / power * (1 + 0.75 * (1 - power) / power)
    return Score(q / math.sqrt(power), math.sqrt(max(variance, 0.0)))


def _uniform(stored: Stored) -> Score:
    # The mean of elements over x and the key r in [0, 1], by symmetry, and over the normal sum of all other summands.
    nodes, weights = np.polynomial.legendre.leggauss(16)
    nodes, weights = (nodes + 1) / 2, weights / 2
    x = nodes[:, None, None]
    key, key_weights = (nodes[:, None], weights[:, None]) if stored.bound else (np.ones((1, 1)), np.ones((1, 1)))
    noise = np.linspace(-8, 8, 321)
    density = np.exp(-(noise**2) / 2) / math.sqrt(2 * math.pi) * (noise[1] - noise[0])
    weight = weights[:, None, None] * key_weights * density
    power = (1 / 9 if stored.bound else 1 / 3) * (stored.count - 1)
    bundle = key * x + math.sqrt(power) * noise
    y = key * (bundle if stored.raw else np.clip(bundle, -1, 1))

    def mean(values: np.ndarray) -> float:
        return float((values * weight).sum())

    products, squares = mean(x * y), mean(y * y)
    varied = x * y / products - y * y / (2 * squares) - x * x * 1.5
    signal = products / math.sqrt(squares / 3)
    return Score(signal, signal * math.sqrt(max(mean(varied**2) - mean(varied) ** 2, 0.0)))


def _holographic(stored: Stored) -> Score:
    power = stored.count + 1  # unbinding doubles the power of the right pair
    return _normal(stored, 1 - 2 / power + 4 / power**3)


def _vector_derived(stored: Stored) -> Score:
    power = stored.count + 1
    return _normal(stored, 1 - 2 / power + 1 / (2 * power**2) + 1 / power**3)


def _normal(stored: Stored, variance: float) -> Score:
    # Products of normal vectors are compared by Fisher's z, the arc tangent of their cosine, whose deviation is
    # 1 / √(d - 2): by a cosine as large as that of a few summands the normal approximation would be off.
    k = stored.count
    if not stored.bound:
        return Score(math.atanh(1 / math.sqrt(k)), 1.0, 2) if k > 1 else Score(1.0, 0.0)
    power = k + 1
    return Score(math.atanh(1 / math.sqrt(power)), math.sqrt(variance) / (1 - 1 / power), 2)


def _phasors(stored: Stored) -> Score:
    if stored.raw:
        return Score(math.sqrt(2 / stored.count), _sum(stored).spread)
    first, second = _harmonics(stored.count)
    return Score(math.sqrt(2) * first, math.sqrt(max(1 + second - 2 * first**2, 0.0)))


def _modular(stored: Stored) -> Score:
    if stored.raw or stored.count == 1:
        return _phasors(stored)
    # Rounding to the nearest of 16 angles adds an error that is uniform within half a step, independent of the sum.
    step = math.pi / 16
    first, second = _harmonics(stored.count)
    first, second = first * math.sin(step) / step, second * math.sin(2 * step) / (2 * step)
    return Score(math.sqrt(2) * first, math.sqrt(max(1 + second - 2 * first**2, 0.0)))


def _harmonics(k: int) -> tuple[float, float]:
    """The means of cos(δ) and cos(2δ) for the angle δ between the sum of k random phasors and one of them.

    n · ∫ Jₙ(t) · J₀(t)^(k-1) / t dt from 0 to infinity, for n = 1 and 2.
    """
    if k <= 2:
        return (1.0, 1.0) if k == 1 else (2 / math.pi, 0.0)
    t = torch.arange(1, 40_001, dtype=torch.float64) * 0.01
    j0, j1 = torch.special.bessel_j0(t), torch.special.bessel_j1(t)
    others = j0 ** (k - 1) / t
    # At 0 the integrands are 1/2 and 0.
    first = float((j1 * others).sum() + 0.25) * 0.01
    return first, float(2 * ((2 * j1 / t - j0) * others).sum()) * 0.01


CLOSED_FORMS: dict[str, Callable[[Stored], Score]] = {
    "MAP-I": _sum,
    "MAP-B": _majority,
    "MAP-C": _clipped,
    "BSC": _majority,
    "HRR": _holographic,
    "FHRR": _phasors,
    "MBAT": _sum,  # unbinding is a rotation of blocks, under which noise stays as it is
    "MCR": _modular,
    "VTB": _vector_derived,
}
"""The score of the right item, by the name of the architecture."""


def _binomial(n: int, k: int) -> float:
    """C(n, k) / 2^n, even if C(n, k) or 2^n is too large for a float."""
    return math.exp(math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1) - n * math.log(2))
