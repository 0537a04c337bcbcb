"""Options that cannot work are refused when they are given; numbers of NumPy are as good as Python's."""

import math
from typing import Any, cast

import numpy as np
import pytest

from behaviours import RULES, LearningReport
from behaviours.learning import require_rule

NO_NUMBERS = [math.nan, math.inf, -math.inf, "0.1", True, None, 10**400, [0.1]]
NO_WHOLE_NUMBERS = [0, -1, 2.5, 2.0, True, "3", None, math.nan, [3]]
WHOLE = [("error_driven", "epochs"), ("error_driven", "patience")] + [
    ("gradient", option) for option in ("epochs", "batch_size", "patience")
]
REFUSED = [
    *[(rule, option, value) for rule, option in WHOLE for value in NO_WHOLE_NUMBERS],
    *[("gradient", "learning_rate", value) for value in [*NO_NUMBERS, 0, -0.1]],
    *[("gradient", "validation_fraction", value) for value in [*NO_NUMBERS, 1, 1.5, -0.1]],
    *[("gradient", "seed", value) for value in (0.5, "0", None, True, 2**64)],
    *[("gradient", "sparse", value) for value in ("no", 1, None)],
    *[("error_driven", "margin", value) for value in [*NO_NUMBERS, -0.1]],
    *[("error_driven", "average", value) for value in ("no", 1, None)],
    *[("least_squares", "ridge", value) for value in [*NO_NUMBERS, 0, -1e-3] if value is not None],
    *[("one_shot", "sigmas", value) for value in NO_NUMBERS],
    *[("one_shot", "threshold", value) for value in NO_NUMBERS if value is not None],
    *[("one_shot", "clip_each_step", value) for value in ("no", 1, None)],
]


@pytest.mark.parametrize(("rule", "option", "value"), REFUSED)
def test_the_message_names_the_option_its_value_and_what_is_allowed(rule: str, option: str, value: Any) -> None:
    with pytest.raises(
        ValueError, match=rf"^{option} is .*(whole number|finite number|True or False).*; got "
    ) as error:
        RULES[rule](**{option: value})
    assert str(error.value).endswith(f"got {value!r}")


@pytest.mark.parametrize(
    ("rule", "option", "value", "plain"),
    [
        ("error_driven", "epochs", np.int64(7), 7),
        ("error_driven", "margin", np.float32(0.25), 0.25),
        ("error_driven", "average", np.bool_(True), True),
        ("gradient", "batch_size", np.uint8(16), 16),
        ("gradient", "seed", np.int32(-3), -3),
        ("gradient", "learning_rate", np.float64(0.5), 0.5),
        ("gradient", "validation_fraction", 0, 0.0),
        ("least_squares", "ridge", np.int64(2), 2.0),
        ("one_shot", "threshold", np.float32(-0.5), -0.5),
    ],
)
def test_numbers_of_numpy_become_plain_ones(rule: str, option: str, value: Any, plain: Any) -> None:
    stored = getattr(RULES[rule](**{option: value}), option)
    assert stored == plain
    assert type(stored) is type(plain)


def test_a_rule_is_an_object() -> None:
    for name, kind in RULES.items():
        rule = kind()
        assert require_rule(rule) is rule
        for wrong in (name, kind):
            with pytest.raises(TypeError, match=rf"write {kind.__name__}\(\)"):
                require_rule(wrong)
    for wrong in ("guess", None, 5, int):
        with pytest.raises(TypeError, match=r"such as OneShot\(\), ErrorDriven\(\), .*; got"):
            require_rule(wrong)


@pytest.mark.parametrize("value", ["x", None, -1, 2.0, True])
@pytest.mark.parametrize("field", ["samples", "new", "wrong", "presumed_known"])
def test_a_report_counts(field: str, value: Any) -> None:
    good: dict[str, Any] = {"samples": 5, "new": np.int64(4)}
    assert type(LearningReport("one_shot", **good).new) is int
    with pytest.raises(ValueError, match=f"{field} is a whole number of at least 0; got"):
        LearningReport("one_shot", **good | {field: value})
    with pytest.raises(ValueError, match="the rule of a report"):
        LearningReport(cast(Any, 5 if value == "x" else value), **good)
