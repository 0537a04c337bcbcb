"""How many pairs one hypervector holds, in closed form.

A program of `k` pairs is asked with the key of one of them, and the answer compared with `N` items. The own item's
score is a sum over d dimensions, normally distributed for large d, and so are those of the N - 1 rivals. The
answer is right if the own score u is the largest:

    p = ∫ φ(u; μ_h, σ_h²) · Φ((u - μ_r) / σ_r)^(N-1) du

Keys, values and items are independent random atoms. Nothing here draws any: the numbers are what an average
over many draws tends to.

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

    by the trapezoidal rule in float64, whose error vanishes exponentially for so smooth an integrand. Raises
    `ValueError` unless `items` is at least 1 and `spread` at least 0.
    """
    if items < 1 or spread < 0:
        raise ValueError(f"items is at least 1 and spread at least 0; got {items} and {spread}")
    # 10 standard deviations either way hold all but 1e-23 of the normal distribution.
    x = torch.linspace(-10, 10, 2001, dtype=torch.float64)
    density = torch.exp(-(x**2) / 2) / math.sqrt(2 * math.pi)
    # As a logarithm, since the power of a small number would underflow.
    beaten = torch.exp((items - 1) * torch.special.log_ndtr(signal + spread * x))
    return min(float(torch.trapezoid(density * beaten, x)), 1.0)


def recall_probability(name: str, dim: int, pairs: int, items: int, atoms: Atoms = "bipolar") -> float:
    """The share of pairs that one hypervector of `dim` numbers recalls of `pairs` bundled in one step.

    `name` is an architecture of `CLOSED_FORMS`; `items` counts what the answer is compared with. With the own score's
    mean s and deviation t in units of the rivals' deviation:

    | name | s | t |
    |---|---|---|
    | MAP-I | √(d/k) | √((k - 1)/k) |
    | MAP-B, BSC | √d · q, with q = C(K-1, (K-1)/2) / 2^(K-1), and K = k or, for even k, k + 1 | √(1 - q²) |
    | MAP-C | √d · q/√e, with q, e the mean and the mean square of an element times its own voter | √(1 - q²/e) |
    | MAP-C, `atoms="uniform"` | √(d/3) · g/√P, with g the slope and P the power of a clipped normal sum | 1 |

    The raw sum of MAP-C and of MAP-B is that of MAP-I. For uniform atoms the pairs are members of a bundle without
    keys, since a product of uniform atoms is not uniform.

    >>> round(recall_probability("MAP-C", 300, 15, 1000, atoms="uniform"), 3)
    0.747
    """
    form = _form(name, atoms)
    if dim < 1 or pairs < 1:
        raise ValueError(f"dim and pairs are at least 1; got {dim} and {pairs}")
    signal, spread = form(pairs)
    return winner_probability(math.sqrt(dim) * signal, spread, items)


def dim_needed(name: str, pairs: int, items: int, accuracy: float = 0.99, atoms: Atoms = "bipolar") -> int:
    """The least number of dimensions at which `pairs` are recalled with `accuracy`; see `recall_probability`."""
    _check_share(accuracy)
    if items == 1:
        return 1
    return _first(lambda dim: recall_probability(name, dim, pairs, items, atoms) >= accuracy)


def pairs_held(name: str, dim: int, items: int, accuracy: float = 0.99, atoms: Atoms = "bipolar") -> int:
    """The largest number of pairs recalled with `accuracy`; 0 if not even one is.

    Raises `ValueError` for one item, of which any number is recalled. An even number may be held where the odd one
    below it is not: MAP-C keeps a split vote as 0, which misleads less than a vote that is lost.
    """
    _check_share(accuracy)
    if items == 1:
        raise ValueError("any number of pairs is recalled where there is 1 item; give at least 2")
    odd, even = (
        _first(lambda half, odd=odd: recall_probability(name, dim, 2 * half - odd, items, atoms) < accuracy)
        for odd in (1, 0)
    )
    # The last odd number that is held is 2 · odd - 3, the last even one 2 · even - 2.
    return max(2 * odd - 3, 2 * even - 2, 0)


def _map_i(pairs: int) -> tuple[float, float]:
    return 1 / math.sqrt(pairs), math.sqrt((pairs - 1) / pairs)


def _map_b(pairs: int) -> tuple[float, float]:
    voters = pairs + (pairs + 1) % 2  # a split vote is decided by one more
    q = _binomial(voters - 1, (voters - 1) // 2)
    return q, math.sqrt(max(1 - q * q, 0.0))


def _map_c(pairs: int) -> tuple[float, float]:
    # Of the other k - 1 voters, those matter who leave the decision to the own one.
    q = _binomial(pairs - 1, pairs // 2)
    power = 1 - (_binomial(pairs, pairs // 2) if pairs % 2 == 0 else 0.0)  # split votes leave a 0
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
"""For a number of pairs: the own score's mean per √d and its deviation, in units of the rivals' deviation."""


def _form(name: str, atoms: str) -> Callable[[int], tuple[float, float]]:
    if name not in CLOSED_FORMS:
        raise ValueError(f"there is no closed form for {name!r}; choose one of {', '.join(CLOSED_FORMS)}")
    if atoms == "bipolar":
        return CLOSED_FORMS[name]
    if atoms != "uniform" or name != "MAP-C":
        raise ValueError(f"atoms are 'bipolar', or 'uniform' with MAP-C; got {atoms!r} with {name}")
    return _map_c_uniform


def _binomial(n: int, k: int) -> float:
    """C(n, k) / 2^n, also where either is too large for a float."""
    return math.exp(math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1) - n * math.log(2))


def _check_share(accuracy: float) -> None:
    if not 0 < accuracy < 1:
        raise ValueError(f"accuracy is a share between 0 and 1; got {accuracy}")


def _first(holds: Callable[[int], bool]) -> int:
    """The least positive integer at which `holds`, which is true from there on."""
    high = 1
    while not holds(high):
        high *= 2
    low = high // 2
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high
