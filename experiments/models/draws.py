"""Random numbers for each episode and step, drawn in order from a generator per episode, with an explicit state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Draw = Callable[[np.random.Generator, int], NDArray[np.float64]]
"""Random numbers `[rows, n]` from a generator. Fewer rows must be the beginning of more."""

AHEAD = 256
"""Rows that are drawn at once: setting up a generator takes as long as some hundred draws (about 15 µs)."""


class Drawn(NamedTuple):
    """The state of `B` generators of the type PCG64, which draw ahead.

    Attributes:
        words: `[B, 4]`, uint64: the two 128-bit numbers of a generator that has drawn the rows of `ahead`.
        ahead: `[B, AHEAD, n]`.
        used: `[B]`, how many rows of `ahead` have been returned.
    """

    words: NDArray[np.uint64]
    ahead: NDArray[np.float64]
    used: NDArray[np.int64]


def start(seeds: Sequence[Sequence[int]], draw: Draw) -> Drawn:
    """The state of generators with these seeds (see `numpy.random.default_rng`), before the first draw."""
    generators = [np.random.Generator(np.random.PCG64(list(seed))) for seed in seeds]
    ahead = np.stack([draw(generator, AHEAD) for generator in generators])
    return Drawn(np.array([_words(one) for one in generators], np.uint64), ahead, np.zeros(len(ahead), np.int64))


def step(drawn: Drawn, draw: Draw) -> tuple[NDArray[np.float64], Drawn]:
    """The next random numbers `[B, n]`, and the state after them. `draw` is the one of `start`."""
    words, ahead, used = drawn
    if (used == AHEAD).any():
        words, ahead, used = words.copy(), ahead.copy(), used % AHEAD
        for row in np.flatnonzero(drawn.used == AHEAD).tolist():
            generator = _generator(words[row].tolist())
            ahead[row], words[row] = draw(generator, AHEAD), _words(generator)
    return ahead[np.arange(len(ahead)), used], Drawn(words, ahead, used + 1)


def _words(generator: np.random.Generator) -> list[int]:
    state: Any = generator.bit_generator.state["state"]
    return [half for number in (state["state"], state["inc"]) for half in divmod(number, 1 << 64)]


def _generator(words: Sequence[int]) -> np.random.Generator:
    numbers: Any = {"state": (words[0] << 64) + words[1], "inc": (words[2] << 64) + words[3]}
    bits = np.random.PCG64(0)
    bits.state = {"bit_generator": "PCG64", "state": numbers, "has_uint32": 0, "uinteger": 0}
    return np.random.Generator(bits)
