"""Which of many normally distributed scores are the largest."""

import math

import torch
from torch import Tensor


def winner_probability(signal: float, spread: float, items: int) -> float:
    """The probability that a score drawn from N(signal, spread²) exceeds N - 1 scores drawn from N(0, 1).

        p = ∫ φ(x) · Φ(signal + spread · x)^(N-1) dx

    by the trapezoidal rule in float64, whose error falls exponentially for such a smooth integrand. Raises
    `ValueError` unless `items` is at least 1 and `spread` at least 0.
    """
    _check(spread, items)
    x, density = _normal()
    # In logarithms, since the power of a small number would underflow.
    beaten = torch.exp((items - 1) * torch.special.log_ndtr(signal + spread * x))
    return min(float(torch.trapezoid(density * beaten, x)), 1.0)


def top_probability(signal: float, spread: float, members: int, items: int) -> float:
    """The expected share of k members among the k largest of N scores.

    The members' scores are drawn from N(signal, spread²), the N - k others from N(0, 1), all independently. A member
    with the score u is among the k largest if at most k - 1 other scores are larger:

        p = ∫ φ(x) · P(B₁ + B₂ <= k - 1) dx,   u = signal + spread · x
        B₁ ~ Binomial(N - k, 1 - Φ(u)),   B₂ ~ Binomial(k - 1, 1 - Φ(x))

    With one member it is `winner_probability`. Raises `ValueError` unless `members` is from 1 to `items` and `spread`
    at least 0.
    """
    _check(spread, items)
    if not 1 <= members <= items:
        raise ValueError(f"the members of a bundle are from 1 to items={items}; got {members}")
    x, density = _normal()
    strangers = _binomial(items - members, signal + spread * x, members)
    rivals = _binomial(members - 1, x, members).cumsum(1)
    kept = (strangers * rivals.flip(1)).sum(1)
    return min(float(torch.trapezoid(density * kept, x)), 1.0)


def _check(spread: float, items: int) -> None:
    if items < 1 or spread < 0:
        raise ValueError(f"items is at least 1 and spread at least 0; got {items} and {spread}")


def _normal() -> tuple[Tensor, Tensor]:
    """Points and the normal density there: all but 1e-23 of it is within 10 standard deviations."""
    x = torch.linspace(-10, 10, 2001, dtype=torch.float64)
    return x, torch.exp(-(x**2) / 2) / math.sqrt(2 * math.pi)


def _binomial(count: int, beaten: Tensor, limit: int) -> Tensor:
    """The probabilities that 0 to `limit` - 1 of `count` normal scores exceed each of these: `[len, limit]`."""
    above = torch.arange(limit, dtype=torch.float64)
    below = count - above
    # `lgamma` is infinite where `below` is negative, which makes the probability 0.
    ways = math.lgamma(count + 1) - torch.lgamma(above + 1) - torch.lgamma(below + 1)
    exceeds, fails = torch.special.log_ndtr(-beaten), torch.special.log_ndtr(beaten)
    return torch.exp(ways + above * exceeds[:, None] + below * fails[:, None])
