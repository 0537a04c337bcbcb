"""How much is recalled, how many dimensions that takes, and how many pairs are held."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

from torchvsa.capacity._forms import CLOSED_FORMS, Atoms, Score, Stored
from torchvsa.capacity._winners import top_probability, winner_probability

if TYPE_CHECKING:
    from torchvsa.architectures.base import VSA

Kind = Literal["pairs", "bundle"]


def recall_probability(
    vsa: "VSA | str",
    dim: int,
    pairs: int,
    items: int,
    atoms: Atoms | None = None,
    *,
    kind: Kind = "pairs",
    raw: bool = False,
) -> float:
    """The fraction of `pairs`, bundled in one step, that one hypervector of `dim` numbers recalls.

    It holds for one-shot sums: each pair is added once, all keys, values and items are independent random hypervectors.
    It does not hold for trained programs, nor for keys that resemble each other.

    Args:
        vsa: An architecture, of which the dimension does not count, or the name of one in `CLOSED_FORMS`.
        dim: Number of dimensions d.
        pairs: Number of pairs k, or of members of the bundle.
        items: Number of items N that the answer is compared with.
        atoms: Distribution of the elements of random hypervectors of MAP-C; by default that of the architecture, and
            "bipolar" for a name.
        kind: What is stored and asked. "pairs": each key is unbound, and the most similar item is the answer. "bundle":
            k of the items, without keys; the k items that are most similar to their bundle are the answer.
        raw: Whether the sum is a raw accumulator (`VSA.superpose`, `behaviours.OneShot`) instead of a bundle
            (`VSA.bundle`), which is normalised once.

    Raises:
        ValueError: There is no closed form for the architecture, or a number is out of range.

    >>> round(recall_probability("MAP-I", 4000, 100, 1000), 3)
    0.998
    """
    score = _form(vsa, atoms, kind, raw)
    _check_counts(pairs, items, kind)
    if dim < 1:
        raise ValueError(f"dim is at least 1; got {dim}")
    return _probability(score(pairs), dim, pairs, items, kind)


def dim_needed(
    vsa: "VSA | str",
    pairs: int,
    items: int,
    accuracy: float = 0.99,
    atoms: Atoms | None = None,
    *,
    kind: Kind = "pairs",
    raw: bool = False,
) -> int:
    """The smallest number of dimensions at which `pairs` are recalled with `accuracy`.

    For one-shot sums, not for trained programs: see `recall_probability`, also for the arguments. If `vsa` is an
    architecture, it is the smallest number that the architecture allows.
    """
    _check_fraction(accuracy)
    form = _form(vsa, atoms, kind, raw)
    _check_counts(pairs, items, kind)
    score = form(pairs)
    everything = items == (1 if kind == "pairs" else pairs)  # any answer is right
    dim = 1 if everything else _first(lambda dim: _probability(score, dim, pairs, items, kind) >= accuracy)
    while not isinstance(vsa, str) and not vsa.allows_dim(dim):
        dim += 1
    return dim


def pairs_held(
    vsa: "VSA | str",
    dim: int,
    items: int,
    accuracy: float = 0.99,
    atoms: Atoms | None = None,
    *,
    raw: bool = False,
) -> int:
    """The largest number of pairs recalled with `accuracy`; 0 if there is none.

    For one-shot sums, not for trained programs: see `recall_probability`, also for the arguments.

    Raises `ValueError` for one item, which is always right. An even number may be held where the odd one below it is
    not: MAP-C keeps a tie as 0, which misleads less than a wrong sign.
    """
    _check_fraction(accuracy)
    if items == 1:
        raise ValueError("any number of pairs is recalled if there is only 1 item; give at least 2")
    odd, even = (
        _first(lambda half, odd=odd: recall_probability(vsa, dim, 2 * half - odd, items, atoms, raw=raw) < accuracy)
        for odd in (1, 0)
    )
    # The last odd number that is held is 2 · odd - 3, the last even one 2 · even - 2.
    return max(2 * odd - 3, 2 * even - 2, 0)


def _form(vsa: "VSA | str", atoms: Atoms | None, kind: Kind, raw: bool) -> Callable[[int], Score]:
    name = vsa if isinstance(vsa, str) else vsa.name
    if name not in CLOSED_FORMS:
        raise ValueError(f"there is no closed form for {name!r}; choose one of {', '.join(CLOSED_FORMS)}")
    if kind not in ("pairs", "bundle"):
        raise ValueError(f"kind is 'pairs' or 'bundle'; got {kind!r}")
    own: Atoms = getattr(vsa, "atoms", "bipolar")
    chosen = own if atoms is None else atoms
    if chosen not in ("bipolar", "uniform") or (chosen == "uniform" and name != "MAP-C"):
        raise ValueError(f"atoms are 'bipolar', or 'uniform' with MAP-C; got {chosen!r} with {name}")
    return lambda count: CLOSED_FORMS[name](Stored(count, kind == "pairs", raw, chosen))


def _probability(score: Score, dim: int, count: int, items: int, kind: Kind) -> float:
    signal = math.sqrt(max(dim - score.lost, 0)) * score.signal
    if kind == "pairs":
        return winner_probability(signal, score.spread, items)
    return top_probability(signal, score.spread, count, items)


def _check_counts(pairs: int, items: int, kind: Kind) -> None:
    if pairs < 1 or items < 1:
        raise ValueError(f"pairs and items are at least 1; got {pairs} and {items}")
    if kind == "bundle" and pairs > items:
        raise ValueError(f"the members of a bundle are at most items={items}; got {pairs}")


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
