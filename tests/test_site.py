"""The site: its code runs, its links lead somewhere, and docstrings become what Sphinx reads."""

import contextlib
import doctest
import importlib
import io
import re
import sys
from pathlib import Path

import pytest
from packages import ROOT

DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))
from docstrings import converted  # noqa: E402 (of the site)

PAGES = ["start", "how", "own-robot", "formats", "architectures", "estimators", "smooth"]


@pytest.mark.parametrize("page", PAGES)
def test_the_code_of_a_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / f"{page}.md").read_text(), re.DOTALL)
    assert blocks
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile("\n".join(blocks), page, "exec"), {"__name__": "__main__"})
    if page == "start":
        assert "tensor([[1.]]" in printed.getvalue()
        assert (tmp_path / "bank.safetensors").exists()
    if page == "formats":
        # Each log that is read from a file has the rows that were written.
        assert re.findall(r"Log\((\d+) rows", printed.getvalue()) == ["3", "4", "3", "500", "500"]
        assert (tmp_path / "own/cart-v0/data/main_data.hdf5").exists()
    if page == "how":
        unrelated, same, member = (float(one) for one in re.findall(r"tensor\(([-\d.]+)\)", printed.getvalue()))
        assert abs(unrelated) < 0.08
        assert same == 1
        assert 0.4 < member < 0.6


MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for package in ("torchvsa", "behaviours", "sim", "experiments")
    for path in sorted((ROOT / package).rglob("*.py"))
    if re.search(r"^ *>>> ", path.read_text(), re.MULTILINE)
]


@pytest.mark.parametrize("module", MODULES)
def test_the_examples_of_docstrings_print_what_they_say(module: str) -> None:
    found = doctest.testmod(importlib.import_module(module))
    assert found.attempted > 0
    assert found.failed == 0


def headings(page: Path) -> set[str]:
    titles = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md"))], ids=str)
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```|`[^`]*`", "", page.read_text(), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith("http"):
            continue
        path, _, anchor = target.partition("#")
        other = page if not path else page.parent / path
        assert other.exists(), target
        if anchor and other.suffix == ".md":
            assert anchor in headings(other), target


def test_every_page_is_in_the_contents() -> None:
    listed = re.findall(r"```\{toctree\}(.*?)```", (DOCS / "index.md").read_text(), re.DOTALL)
    names = {line for block in listed for line in block.splitlines() if line and not line.startswith(":")}
    assert names | {"index"} == {page.stem for page in DOCS.glob("*.md")}


def test_tables_blocks_and_bars_of_docstrings_are_converted() -> None:
    given = ["Of |x|:", "", "    x = 1", "    y = `|`", "", "| a | b |", "|---|---|", "| 1 | `c` |", "", "End `|x|`."]
    made = [line for line in converted(given) if line]
    assert made == [
        "Of \\|x\\|:",
        "::",
        "    x = 1",
        "    y = `|`",
        ".. list-table::",
        "   :header-rows: 1",
        "   * - a",
        "     - b",
        "   * - 1",
        "     - `c`",
        "End `|x|`.",
    ]
