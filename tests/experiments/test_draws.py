"""Random numbers with an explicit state: those of one generator per episode, in any batch and any order."""

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.models import draws
from experiments.models.draws import AHEAD, Draw
from sim.state import join, rows_of

SEEDS = [(5, 1), (5, 9), (2, 1)]
STEPS = 2 * AHEAD + 20


def uniform(generator: np.random.Generator, rows: int) -> NDArray[np.float64]:
    return generator.uniform(-1, 1, (rows, 2))


def normal(generator: np.random.Generator, rows: int) -> NDArray[np.float64]:
    return generator.standard_normal((rows, 3))


@pytest.mark.parametrize("draw", [uniform, normal])
def test_numbers_drawn_step_by_step_are_those_of_a_table(draw: Draw) -> None:
    tables = [draw(np.random.default_rng(seed), STEPS) for seed in SEEDS]
    drawn = draws.start(SEEDS[:2], draw)
    # The third begins a hundred steps later, so that they draw ahead at different steps.
    for step in range(STEPS - 100):
        if step == 100:
            drawn = rows_of(join(drawn, draws.start(SEEDS[2:], draw)), np.array([2, 0, 1]))
        numbers, drawn = draws.step(drawn, draw)
        late = [] if step < 100 else [tables[2][step - 100]]
        np.testing.assert_array_equal(numbers, [*late, tables[0][step], tables[1][step]])


@pytest.mark.parametrize("steps", [3, AHEAD])
def test_a_state_is_a_value_that_can_be_taken_up_again(steps: int) -> None:
    drawn = draws.start(SEEDS, uniform)
    for _ in range(steps):
        _, drawn = draws.step(drawn, uniform)
    (first, after), (again, _) = draws.step(drawn, uniform), draws.step(drawn, uniform)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(draws.step(after, uniform)[0], first)
