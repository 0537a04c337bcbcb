"""Weights of a few summands that keep every wanted answer ahead of all others."""

import numpy as np
from numpy.typing import NDArray

KEPT = 0.9
"""The share of the largest margin that rounding to whole numbers has to keep."""


def largest_margin(leads: NDArray[np.float64]) -> NDArray[np.float64]:
    """The weights `[n]` with `Σ|wᵢ| ≤ 1` whose smallest lead, the margin, is largest; all 0 if none is positive.

    `leads` `[c, n]` holds, for each comparison, by how much each summand of weight 1 helps the wanted answer against
    the other one. Leads are linear in the weights, so this is a linear program.
    """
    from scipy.optimize import linprog  # takes half a second to load

    comparisons, summands = leads.shape
    scaled = leads / (np.abs(leads).max() or 1.0)
    # The unknowns: the positive and the negative part of each weight, and the margin.
    found = linprog(
        np.append(np.zeros(2 * summands), -1.0),
        A_ub=np.vstack(
            [
                np.hstack([-scaled, scaled, np.ones((comparisons, 1))]),
                np.append(np.ones(2 * summands), 0.0),
            ]
        ),
        b_ub=np.append(np.zeros(comparisons), 1.0),
        bounds=[(0, None)] * (2 * summands) + [(None, None)],
    )
    weights = found.x[:summands] - found.x[summands:-1]
    return weights if (leads @ weights > 0).all() else np.zeros(summands)


def margin(leads: NDArray[np.float64], weights: NDArray[np.float64] | NDArray[np.int64]) -> float:
    """The smallest lead of these weights, of which one at least is not 0, scaled to `Σ|wᵢ| = 1`."""
    return float((leads @ weights).min() / np.abs(weights).sum())


def whole(leads: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.int64]:
    """The smallest whole numbers in about the same proportions that keep `KEPT` of their margin, which is positive."""
    wanted, largest = KEPT * margin(leads, weights), 1
    proportions = weights / np.abs(weights).max()
    while margin(leads, rounded := np.round(proportions * largest)) < wanted:
        largest += 1
    return rounded.astype(np.int64)
