"""All studies: each appears by itself, composes, and states what it can be told."""

import dataclasses
from pathlib import Path

import pytest
from kits import composed
from packages import python

from experiments import studies
from experiments.kit import STUDIES
from experiments.kit.help import groups, markdown, markdown_of_group
from experiments.kit.options import options
from experiments.kit.run import check_all

ROOT = Path(__file__).parents[2]
NAMES = (
    "algebra", "capacity", "composition", "corral", "damage", "dimensions", "generalisation", "interference",
    "memories", "observability", "resonator", "robustness", "scale", "sequence", "smooth", "wall_following",
)  # fmt: skip


def test_the_studies_are_all_there() -> None:
    studies.import_all()
    assert set(NAMES) <= set(STUDIES)


@pytest.mark.parametrize("name", NAMES)
def test_every_preset_composes_and_is_allowed(name: str) -> None:
    study = studies.find(name)
    assert dataclasses.is_dataclass(study.settings)
    for preset in (None, *study.presets):
        check_all(study, composed(study, *([] if preset is None else [f"experiment={preset}"])))


def test_the_command_of_a_study_imports_no_other_study() -> None:
    """Also the libraries that others need would take seconds, in each process of a pool."""
    code = """
import sys
from experiments import studies
studies.find("corral")
others = {"experiments.robustness", "experiments.generalisation"}
assert not (others | {"matplotlib", "sklearn", "scipy"}) & set(sys.modules)
"""
    assert python(None, code).returncode == 0


def test_the_page_of_all_settings_is_up_to_date() -> None:
    assert (ROOT / "docs" / "settings.md").read_text() == studies.settings_page()


def test_the_docs_name_every_study() -> None:
    page = (ROOT / "docs" / "studies-index.md").read_text()
    for name in NAMES:
        assert f"| `torchvsa {name}` |" in page
        if (ROOT / "docs" / "results" / f"{name}.md").exists():
            assert f"| `torchvsa {name}` | [{name}](results/{name}.md) |" in page
        study = studies.find(name)
        assert groups(study.settings) is not None
        assert markdown(study).startswith(f"## {name}\n")
    assert "`rule=error_driven`" in markdown_of_group("rule")
    assert "literal" in options("rule")
