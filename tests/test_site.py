"""The site: its code runs, its links lead somewhere, and docstrings become what Sphinx reads."""

import contextlib
import doctest
import importlib
import io
import json
import re
import shlex
import tomllib
from pathlib import Path
from types import FunctionType

import pytest
from check_links import problems
from docstrings import converted
from packages import ROOT, install, python

DOCS = ROOT / "docs"

BLOCKS = {page.stem: re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL) for page in DOCS.glob("*.md")}
ELSEWHERE = {
    "composition": "experiments/test_docs_composition.py",
    "studies": "experiments/test_docs.py",
    "sweeps": "experiments/test_docs.py",
    "torch-hd": "test_torchhd_page.py",
}
"""Pages whose code other tests run."""
OWN_PARTS = ["own-architecture", "own-policy"]
PAGES = sorted(page for page, blocks in BLOCKS.items() if blocks and page not in {*ELSEWHERE, *OWN_PARTS})


def printed_by(code: str) -> str:
    """What code prints that begins anew in this process, whose tests take warnings for errors."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "page", "exec"), {"__name__": "__main__"})
    return printed.getvalue()


@pytest.mark.parametrize("page", PAGES)
def test_the_code_of_a_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    blocks = BLOCKS[page]
    says = "" if page == "tour" else printed_by("\n".join(blocks))
    if page == "start":
        assert "tensor([[1.]]" in says
        assert (tmp_path / "bank.safetensors").exists()
    if page == "formats":
        # Each log that is read from a file has the rows that were written.
        assert re.findall(r"Log\((\d+) rows", says) == ["3", "4", "3", "500", "500"]
        assert (tmp_path / "own/cart-v0/data/main_data.hdf5").exists()
    if page == "how":
        unrelated, same, member = (float(one) for one in re.findall(r"tensor\(([-\d.]+)\)", says))
        assert abs(unrelated) < 0.08
        assert same == 1
        assert 0.4 < member < 0.6
    if page == "memories":
        assert "tensor([0, 1, 2, 3, 4, 5, 6, 7])" in says
        assert "tensor([3, 1, 4])" in says
        assert "turn = 1 if left is" in says
    if page == "pipelines":
        assert float(says.splitlines()[1]) > 0.95
    if page == "tour":
        algebra, kinds, paper, classifier, sums = (printed_by(block) for block in blocks)
        assert algebra.splitlines()[1] == "tensor(3)"
        assert float(kinds) == 1
        assert "SelfShift" in paper
        assert float(classifier) > 0.99
        assert "sum of seek, 2 * avoid" in sums
    if page == "world":
        assert (tmp_path / "drive.rrd").stat().st_size > 1000


def test_pages_whose_code_others_run_are_read_there() -> None:
    for page, test in ELSEWHERE.items():
        assert f'"{page}.md"' in (ROOT / "tests" / test).read_text()


@pytest.mark.slow
@pytest.mark.parametrize("page", OWN_PARTS)
def test_a_part_of_ones_own_keeps_the_laws_and_drives(page: str, tmp_path: Path) -> None:
    text = (DOCS / f"{page}.md").read_text()
    modules = dict(re.findall(r"`(\w+)\.py`:\n\n```python\n(.*?)```", text, re.DOTALL))
    (project,) = (tomllib.loads(block)["project"] for block in re.findall(r"```toml\n(.*?)```", text, re.DOTALL))
    install(tmp_path, project["name"], modules, project["entry-points"]["torchvsa.plugins"])
    used = python(tmp_path, "\n".join(block for block in BLOCKS[page] if block not in modules.values()), cwd=tmp_path)
    assert used.returncode == 0, used.stderr
    if page == "own-architecture":
        assert float(used.stdout.split()[1]) > 0.95
    else:
        assert "['seek', 'avoid']" in used.stdout
    (command,) = re.findall(r"```bash\n(.*?)```", text, re.DOTALL)
    name, *arguments = shlex.split(command, comments=True)
    assert name == "torchvsa"
    small = ("starts=4", "other_starts=4", "demonstrations=8", "vsa.dim=1000", "workers=1", "hydra.run.dir=out")
    ran = python(tmp_path, f"from experiments.main import main; main({[*arguments, *small]})", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    rows = json.loads((tmp_path / "out" / "results.json").read_text())["table"]
    assert {row["controller"] for row in rows} == {"teacher", "default" if page == "own-architecture" else "bundled"}
    assert all(row["heldout_agreement"] > 0.8 for row in rows), rows


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


PACKAGES = [
    "torchvsa",
    "torchvsa.encoders",
    "torchvsa.testing",
    "behaviours",
    "behaviours.data",
    "behaviours.testing",
    "sim",
    "experiments.kit",
]


@pytest.mark.parametrize("package", PACKAGES)
def test_the_reference_has_every_public_class_and_function(package: str) -> None:
    module = importlib.import_module(package)
    listed = re.findall(
        r"^\.\. auto\w+:: (\S+)", "".join(map(Path.read_text, DOCS.glob("reference/*.md"))), re.MULTILINE
    )
    there = {path.rpartition(".")[2] for path in listed}
    public = [name for name in module.__all__ if isinstance(getattr(module, name), type | FunctionType)]
    assert public
    assert [name for name in public if name not in there] == []


def headings(page: Path) -> set[str]:
    titles = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))], ids=str)
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


def test_a_site_with_broken_links_is_told(tmp_path: Path) -> None:
    site = tmp_path / "site"
    site.mkdir()
    (site / "a.html").write_text(
        '<h1 id="top">A</h1><a href="b.html#there">b</a> <a href="#top">up</a> <img src="data:x">'
    )
    (site / "b.html").write_text('<p id="there"></p><a href="https://a.org">a</a> <a href="a.html#top">a</a>')
    assert problems(site) == []
    (site / "c.html").write_text(
        '<a href="d.html"></a><a href="b.html#gone"></a><script src="https://a.org/x.js"></script><img src="x.png">'
    )
    assert problems(site) == [
        "c.html loads https://a.org/x.js",
        "c.html loads x.png, which is not there",
        "c.html links to d.html, which is not there",
        "c.html links to b.html#gone; that page has no such part",
    ]
    assert problems(tmp_path / "empty") == [f"{tmp_path / 'empty'} has no pages"]


def test_every_page_is_in_the_contents() -> None:
    listed = re.findall(r"```\{toctree\}(.*?)```", (DOCS / "index.md").read_text(), re.DOTALL)
    names = {line for block in listed for line in block.splitlines() if line and not line.startswith(":")}
    pages = {page.stem for page in DOCS.glob("*.md")} | {
        f"launchers/{page.stem}" for page in DOCS.glob("launchers/*.md")
    }
    assert names - {"results/*"} | {"index"} == pages


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
