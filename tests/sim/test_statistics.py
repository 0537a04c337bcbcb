import math

import pytest

from sim.statistics import censored_median, wilson


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        # Newcombe 1998, table I, method 3, to the four decimals printed there.
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
        (20, 20, 0.8389, 1.0),
    ],
)
def test_wilson_against_known_values(successes: int, trials: int, low: float, high: float) -> None:
    assert wilson(successes, trials) == pytest.approx((low, high), abs=5e-5)


@pytest.mark.parametrize(("successes", "trials"), [(1, 0), (3, 2), (-1, 2)])
def test_wilson_refuses_impossible_counts(successes: int, trials: int) -> None:
    with pytest.raises(ValueError, match=f"{successes} successes of {trials} trials"):
        wilson(successes, trials)


def test_the_median_counts_what_came_too_late() -> None:
    late = math.inf
    assert censored_median([3.0, 1.0, late]) == 3.0
    assert censored_median([3.0, 1.0, 2.0, late]) == 2.5
    assert censored_median([1.0, late]) is None
    assert censored_median([1.0, late, late]) is None


@pytest.mark.parametrize("times", [[], [1.0, math.nan]])
def test_the_median_refuses_nothing_and_nan(times: list[float]) -> None:
    with pytest.raises(ValueError, match="expected one number per episode"):
        censored_median(times)
