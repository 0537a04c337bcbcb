"""Demonstrations hold what they were given, and refuse what cannot be learned."""

import math

import pytest
from robots import SCHEMA

from behaviours import Demonstrations
from torchvsa import ShapeError


def test_parts_and_joins() -> None:
    shown = Demonstrations([[1.0], [2.0], [3.0]], [[0.1], [0.2], [0.3]], [4, 4, 5])
    kept = shown.where([True, False, True])
    assert kept.sensors.tolist() == [[1.0], [3.0]]
    assert kept.commands.tolist() == [[0.1], [0.3]]
    assert kept.episodes.tolist() == [4, 5]
    joined = Demonstrations.join([kept, shown])
    assert joined.sensors.flatten().tolist() == [1, 3, 1, 2, 3]
    assert joined.commands.flatten().tolist() == [0.1, 0.3, 0.1, 0.2, 0.3]
    assert joined.episodes.tolist() == [4, 5, 4, 4, 5]
    assert Demonstrations([[1.0]], [[2.0]]).episodes.tolist() == [0]
    assert "3 rows, 1 sensors, 1 actuators, 2 episodes" in repr(shown)


@pytest.mark.parametrize("rows", [[], [[]]])
def test_empty(rows: list) -> None:
    with pytest.raises(ShapeError, match=r"sensors must be rows of values, \[N, columns\]; got shape"):
        Demonstrations(rows, rows)


def test_no_rows_of_the_right_width() -> None:
    shown = Demonstrations([[1.0]], [[2.0]])
    with pytest.raises(ValueError, match="at least one row; this one is empty"):
        shown.where([False])


def test_unequal_numbers_of_rows() -> None:
    with pytest.raises(ShapeError, match="commands has 1 rows, but sensors has 2"):
        Demonstrations([[1.0], [2.0]], [[1.0]])
    with pytest.raises(ShapeError, match="episodes has 3 rows, but sensors has 2"):
        Demonstrations([[1.0], [2.0]], [[1.0], [1.0]], [0, 0, 0])


def test_episodes_are_one_number_per_row() -> None:
    with pytest.raises(ShapeError, match=r"episodes must be one number per row, \[N\]; got shape \(2, 1\)"):
        Demonstrations([[1.0], [2.0]], [[1.0], [1.0]], [[0], [1]])


def test_infinite_readings_and_commands_that_are_no_numbers() -> None:
    with pytest.raises(ValueError, match="sensors has an infinite value in row 1, column 0; use NaN"):
        Demonstrations([[1.0], [math.inf]], [[1.0], [1.0]])
    for value in (math.nan, math.inf):
        with pytest.raises(ValueError, match=f"commands has {value} in row 0, column 1"):
            Demonstrations([[math.nan]], [[1.0, value]])


def test_check_against_a_schema() -> None:
    Demonstrations([[0.0, math.nan, 20.0]], [[-1.0, 1.0]]).check(SCHEMA)
    with pytest.raises(ValueError, match=r"sensor 'right' reads -1 in row 0; its range is \[0, 20\]"):
        Demonstrations([[0.0, -1.0, 20.0]], [[-1.0, 1.0]]).check(SCHEMA)
    with pytest.raises(ValueError, match="actuator 'left_motor' is told 3 in row 0"):
        Demonstrations([[0.0, 1.0, 20.0]], [[3.0, 1.0]]).check(SCHEMA)
    with pytest.raises(ShapeError, match=r"sensor readings must be rows of 3 values \(left, right, front\)"):
        Demonstrations([[0.0]], [[3.0, 1.0]]).check(SCHEMA)
