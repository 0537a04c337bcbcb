"""Closed forms of how many pairs one hypervector holds.

A program of `k` pairs is queried with the key of one pair, and the answer is compared with `N` items. The score of each
item is a sum over d dimensions, and so normally distributed for large d. The answer is right if the score u of the
right item (h) exceeds those of the N - 1 others (r):

    p = ∫ φ(u; μ_h, σ_h²) · Φ((u - μ_r) / σ_r)^(N-1) du

Keys, values and items are independent random hypervectors. The results are expectations; nothing is drawn.

Source: Frady, Kleyko and Sommer 2018, "A theory of sequence indexing and working memory in recurrent neural networks",
arXiv 1803.00412.
"""

import math
from collections.abc import Callable
from typing import Literal

import torch

Atoms = Literal["bipolar", "uniform"]


def winner_probability(signal: float, spread: float, items: int) -> float:
    """The probability that a score drawn from N(signal, spread²) exceeds N - 1 scores drawn from N(0, 1).

        p = ∫ φ(x) · Φ(signal + spread · x)^(N-1) dx

    by the trapezoidal rule in float64, whose error falls exponentially for such a smooth integrand. Raises
    `ValueError` unless `items` is at least 1 and `spread` at least 0.
    """
    if items < 1 or spread < 0:
        raise ValueError(f"items is at least 1 and spread at least 0; got {items} and {spread}")
    # All but 1e-23 of the normal distribution is within 10 standard deviations.
    x = torch.linspace(-10, 10, 2001, dtype=torch.float64)
    density = torch.exp(-(x**2) / 2) / math.sqrt(2 * math.pi)
    # In logarithms, since the power of a small number would underflow.
    beaten = torch.exp((items - 1) * torch.special.log_ndtr(signal + spread * x))
    return min(float(torch.trapezoid(density * beaten, x)), 1.0)


def recall_probability(name: str, dim: int, pairs: int, items: int, atoms: Atoms = "bipolar") -> float:
    """The fraction of `pairs`, bundled in one step, that one hypervector of `dim` numbers recalls.

    With the mean s and the standard deviation t of the right item's score, in units of the others' deviation:

    | name | s | t |
    |---|---|---|
    | MAP-I | √(d/k) | √((k - 1)/k) |
    | MAP-B, BSC | √d · q, with q = C(K-1, (K-1)/2) / 2^(K-1), and K = k or, for even k, k + 1 | √(1 - q²) |
    | MAP-C | √d · q/√e, with q, e the mean and the mean square of an element times its summand's | √(1 - q²/e) |
    | MAP-C, `atoms="uniform"` | √(d/3) · g/√P, with g the slope and P the power of a clipped normal sum | 1 |

    The raw sums of MAP-C and MAP-B are those of MAP-I. With uniform atoms the pairs are members of a bundle without
    keys, since a product of uniform numbers is not uniform.

    Args:
        name: An architecture of `CLOSED_FORMS`.
        dim: Number of dimensions d.
        pairs: Number of pairs k.
        items: Number of items N that the answer is compared with.
        atoms: Distribution of the elements of random hypervectors.

    >>> round(recall_probability("MAP-C", 300, 15, 1000, atoms="uniform"), 3)
    0.747
    """
    form = _form(name, atoms)
    if dim < 1 or pairs < 1:
        raise ValueError(f"dim and pairs are at least 1; got {dim} and {pairs}")
    signal, spread = form(pairs)
    return winner_probability(math.sqrt(dim) * signal, spread, items)


def dim_needed(name: str, pairs: int, items: int, accuracy: float = 0.99, atoms: Atoms = "bipolar") -> int:
    """The smallest number of dimensions at which `pairs` are recalled with `accuracy` (see `recall_probability`)."""
    _check_fraction(accuracy)
    if items == 1:
        return 1
    return _first(lambda dim: recall_probability(name, dim, pairs, items, atoms) >= accuracy)


def pairs_held(name: str, dim: int, items: int, accuracy: float = 0.99, atoms: Atoms = "bipolar") -> int:
    """The largest number of pairs recalled with `accuracy`; 0 if there is none.

    Raises `ValueError` for one item, which is always right. An even number may be held where the odd one below it is
    not: MAP-C keeps a tie as 0, which misleads less than a wrong sign.
    """
    _check_fraction(accuracy)
    if items == 1:
        raise ValueError("any number of pairs is recalled if there is only 1 item; give at least 2")
    odd, even = (
        _first(lambda half, odd=odd: recall_probability(name, dim, 2 * half - odd, items, atoms) < accuracy)
        for odd in (1, 0)
    )
    # The last odd number that is held is 2 · odd - 3, the last even one 2 · even - 2.
    return max(2 * odd - 3, 2 * even - 2, 0)


def _map_i(pairs: int) -> tuple[float, float]:
    return 1 / math.sqrt(pairs), math.sqrt((pairs - 1) / pairs)


def _map_b(pairs: int) -> tuple[float, float]:
    voters = pairs + (pairs + 1) % 2  # one more summand decides ties
    q = _binomial(voters - 1, (voters - 1) // 2)
    return q, math.sqrt(max(1 - q * q, 0.0))


def _map_c(pairs: int) -> tuple[float, float]:
    # A summand decides an element if the other k - 1 are tied.
    q = _binomial(pairs - 1, pairs // 2)
    power = 1 - (_binomial(pairs, pairs // 2) if pairs % 2 == 0 else 0.0)  # ties leave a 0
    return q / math.sqrt(power), math.sqrt(max(1 - q * q / power, 0.0))


def _map_c_uniform(pairs: int) -> tuple[float, float]:
    sigma = math.sqrt(pairs / 3)
    c = 1 / sigma
    slope = math.erf(c / math.sqrt(2))
    inside = slope - math.sqrt(2 / math.pi) * c * math.exp(-c * c / 2)
    power = sigma * sigma * inside + math.erfc(c / math.sqrt(2))
    return slope / math.sqrt(3 * power), 1.0


CLOSED_FORMS: dict[str, Callable[[int], tuple[float, float]]] = {
    "MAP-I": _map_i,
    "MAP-B": _map_b,
    "MAP-C": _map_c,
    "BSC": _map_b,
}
"""Maps k to the mean of the right score per √d and its deviation, in units of the others' deviation."""


def _form(name: str, atoms: str) -> Callable[[int], tuple[float, float]]:
    if name not in CLOSED_FORMS:
        raise ValueError(f"there is no closed form for {name!r}; choose one of {', '.join(CLOSED_FORMS)}")
    if atoms == "bipolar":
        return CLOSED_FORMS[name]
    if atoms != "uniform" or name != "MAP-C":
        raise ValueError(f"atoms are 'bipolar', or 'uniform' with MAP-C; got {atoms!r} with {name}")
    return _map_c_uniform


def _binomial(n: int, k: int) -> float:
    """C(n, k) / 2^n, even if C(n, k) or 2^n is too large for a float."""
    return math.exp(math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1) - n * math.log(2))


def _check_fraction(accuracy: float) -> None:
    if not 0 < accuracy < 1:
        raise ValueError(f"accuracy is a fraction between 0 and 1; got {accuracy}")


def _first(holds: Callable[[int], bool]) -> int:
    """The smallest positive integer at which `holds` is true, given that it stays true."""
    high = 1
    while not holds(high):
        high *= 2
    low = high // 2
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high
