"""Sphinx: `make docs` builds the site into docs/_build/html."""

import sys
from importlib.metadata import version as installed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from docstrings import converted

from experiments import studies
from experiments.kit import STUDIES

ROOT = Path(__file__).parents[1]

project = "torchvsa"
author = "The torchvsa developers"
copyright = "2026, the torchvsa developers"
version = release = installed("torchvsa")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_design",
]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4
autodoc_default_options = {"members": True, "member-order": "bysource"} | {
    "exclude-members": "set_fit_request, set_partial_fit_request, set_score_request"
}
autodoc_typehints = "none"
napoleon_use_ivar = True
default_role = "code"
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"torchvsa {release}"
html_theme_options = {"source_view_link": "", "navigation_with_keys": True}
html_show_sphinx = False


def all_studies() -> str:
    """Every study that is installed: its question, its settings, and its page of results if there is one."""
    studies.import_all()
    lines = ["", "## All studies", ""]
    for name, study in sorted(STUDIES.items()):
        page = f"results/{name}.md"
        results = f", [results]({page})" if (ROOT / "docs" / page).exists() else ""
        lines.append(f"- `torchvsa {name}`: {study.about} [Settings](settings.md#{name.replace('_', '-')}){results}")
    return "\n".join([*lines, ""])


def read(_: object, name: str, source: list[str]) -> None:
    """Fill the pages of changes and of studies; links to the README lead to the page that starts as it does."""
    if name == "changelog":
        source[0] = (ROOT / "CHANGELOG.md").read_text().replace("](docs/", "](")
    elif name == "studies-index":
        source[0] += all_studies()
    source[0] = source[0].replace("](../README.md)", "](start.md)").replace("](../sim/arenas)", "](world.md)")


def markdown(_app: object, _kind: str, _name: str, _what: object, _options: object, lines: list[str]) -> None:
    """Convert a docstring in place."""
    lines[:] = converted(lines)


def setup(app: object) -> None:
    """Called by Sphinx."""
    connect = app.connect  # type: ignore[attr-defined] (an application of Sphinx)
    connect("source-read", read)
    connect("autodoc-process-docstring", markdown, priority=600)  # after napoleon
