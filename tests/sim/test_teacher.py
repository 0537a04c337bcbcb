import itertools

import numpy as np
import pytest

import sim
from sim.sensors import DISTANCE_MAX, LIGHT_MAX
from sim.teachers.escape import OBSTACLE

# The five rules of the paper's section IV, for each combination of what is sensed: left light, right light, obstacle.
TRUTH: dict[tuple[bool, ...], tuple[str, list[int]]] = {
    (True, True, True): ("stay_in_light", [1, 1]),
    (True, True, False): ("stay_in_light", [1, 1]),
    (True, False, True): ("turn_left_to_light", [-1, 1]),
    (True, False, False): ("turn_left_to_light", [-1, 1]),
    (False, True, True): ("turn_right_to_light", [1, -1]),
    (False, True, False): ("turn_right_to_light", [1, -1]),
    (False, False, True): ("avoid_obstacle", [-1, 1]),
    (False, False, False): ("cruise", [1, 1]),
}


def test_truth_table() -> None:
    cases = list(itertools.product([True, False], repeat=3))
    sensors = np.array([[1.0 if left else LIGHT_MAX, 1.0 if right else LIGHT_MAX, 0.1 if near else 0.5]
                        for left, right, near in cases])  # fmt: skip
    commands = sim.Teacher()(sensors)
    rules = sim.Teacher().rule(sensors)
    assert commands.dtype == np.float64
    assert [(sim.TEACHER_RULES[rule], command.tolist()) for rule, command in zip(rules, commands, strict=True)] == [
        TRUTH[case] for case in cases
    ]


def test_thresholds_are_strict() -> None:
    teacher = sim.Teacher()
    assert teacher.rule(np.array([[LIGHT_MAX, LIGHT_MAX, OBSTACLE]])) == sim.TEACHER_RULES.index("cruise")
    assert teacher.rule(np.array([[LIGHT_MAX, LIGHT_MAX, np.nextafter(OBSTACLE, 0)]])) == sim.TEACHER_RULES.index(
        "avoid_obstacle"
    )
    assert teacher.rule(np.array([[np.nextafter(LIGHT_MAX, 0), LIGHT_MAX, 0.0]])) == 1


@pytest.mark.parametrize("bins", [16, 20, 24, 32, 48, 64])
def test_the_obstacle_threshold_is_not_handed_to_equal_bins(bins: int) -> None:
    inside = OBSTACLE / DISTANCE_MAX * bins % 1
    assert 0.1 < inside < 0.9


def test_behaviours_partition_the_rules() -> None:
    assert sorted(rule for rules in sim.BEHAVIOURS.values() for rule in rules) == list(range(len(sim.TEACHER_RULES)))


def test_the_answer_may_be_changed_without_changing_the_teacher() -> None:
    sensors = np.full((2, 3), 0.1)
    sim.Teacher()(sensors)[:] = 7.0
    assert sim.Teacher()(sensors).tolist() == [[1, 1], [1, 1]]


@pytest.mark.parametrize("shape", [(3,), (2, 2), (1, 2, 3)])
def test_wrong_shapes_are_named(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"expected \[B, 3\] \(light_left, light_right, distance\)"):
        sim.Teacher()(np.zeros(shape))
