"""Settings: each is checked, named in errors, and explained."""

import re

import pytest
from counting import study
from kits import composed

from experiments.kit import STUDIES
from experiments.kit.help import groups
from experiments.kit.options import GROUPS, described_option, options
from experiments.kit.run import check_all
from experiments.kit.settings import described


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("names=[a,d]", "names: there is no 'd'; choose from a, b, c"),
        ("names=[a,a]", "names names 'a' 2 times"),
        ("names=[]", "names is empty; choose from a, b, c"),
        ("repeats=0", "repeats=0: expected a number from 1 to 100"),
        ("repeats=101", "repeats=101: expected a number from 1 to 100"),
        ("share=0", "share=0: expected more than 0 and less than 1"),
        ("share=nan", "share=nan: expected a finite number, more than 0"),
        ("seconds=inf", "seconds=inf: expected a finite number, 0 or more"),
        ("workers=0", "workers=0: expected a number from 1 to 1000"),
        ("names=[[a]]", "names=[[a]]: expected a list without lists in it"),
        ("fail_at=9999999999", "fail_at=9999999999: expected at most 2147483647"),
        ("seed=-1", "seed=-1: expected 0 or more"),
    ],
)
def test_what_is_not_allowed_is_named(override: str, words: str) -> None:
    settings = composed(study, override)
    with pytest.raises(ValueError, match=re.escape(words)):
        check_all(study, settings)


def test_defaults_are_those_of_the_classes_and_presets_change_them() -> None:
    assert composed(study).rule == {
        "name": "error_driven", "margin": 5.0, "epochs": 200, "contradictions": "majority", "average": False,
        "patience": 30, "evidence": 0.0,
    }  # fmt: skip
    assert composed(study, "experiment=quick").repeats == 1
    printed = composed(study, "experiment=printed", "rule.sigmas=3")
    assert printed.share == 0.25
    assert printed.rule["name"] == "one_shot"
    assert printed.rule["novelty"] == "similarity"
    assert printed.rule["sigmas"] == 3


def test_every_setting_of_every_study_and_option_has_a_meaning() -> None:
    for other in STUDIES.values():
        for one in described(other.settings):
            assert one.about, f"{other.name}: {one.name}"
        for group in groups(other.settings):
            for option in options(group):
                for name, _, about in described_option(group, option):
                    assert about, f"{group}={option}: {name}"
    assert set(GROUPS) >= {"vsa", "encoder", "record", "protection", "rule", "composition"}


def test_a_described_option_shows_what_its_preset_changes() -> None:
    assert ("dtype", "int8") in [row[:2] for row in described_option("vsa", "map_c")]
    assert ("dtype", "float32") in [row[:2] for row in described_option("vsa", "hrr")]
    assert ("clip_each_step", "true") in [row[:2] for row in described_option("rule", "literal")]
