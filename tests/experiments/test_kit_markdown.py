"""A page as Markdown: the same words and pictures, however hostile the text."""

import html
import re
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from matplotlib.figure import Figure
from test_kit_page import HOSTILE, png

from experiments.kit import Column, Page, Table
from experiments.kit.markdown import markdown, write_markdown


def rendered(text: str) -> str:
    """What a reader of Markdown makes of it."""
    return MarkdownIt("commonmark").enable("table").render(text)


def words(page: str) -> str:
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", page)).split())


def letters(text: str) -> str:
    """The text without spaces and backticks."""
    return re.sub(r"[\s`]", "", text)


def test_tables_pictures_terms_and_code_are_there(tmp_path: Path) -> None:
    page = Page("Recall", "How much?", "All of it.")
    section = page.section("First")
    section.text("read `a_b * c` twice", "- no list")
    table = Table("t", [Column("name"), Column("rate", format=".2f", best="max")], "of ten")
    section.table(table.show([{"name": "a|b", "rate": 1.0}, {"name": "c", "rate": 0.5}]))
    section.terms({"rate": "the share"})
    section.picture(png(), "a red square", "It is red.")
    section.code("print(1)\n```\n", "Type:")
    path = write_markdown(page, tmp_path / "recall.md")
    (picture,) = (tmp_path / "recall").iterdir()
    assert picture.read_bytes() == png()
    shown = rendered(path.read_text())
    assert "<h1>Recall</h1>" in shown
    assert "<p><strong>All of it.</strong></p>" in shown
    assert "<p>read <code>a_b * c</code> twice</p>\n<p>- no list</p>" in shown
    assert re.search(r"<td>a\|b</td>\s*<td [^>]*><strong>1.00</strong></td>", shown)
    assert "<li>rate: the share</li>" in shown
    assert f'<img src="recall/{picture.name}" alt="a red square" />' in shown
    assert '<code class="language-text">print(1)\n```\n</code>' in shown


def undrawable() -> Figure:
    raise AttributeError("nothing to draw")


def test_a_figure_keeps_its_name_and_one_that_fails_is_told(tmp_path: Path) -> None:
    page = Page("t")
    section = page.section("s")
    section.figure("curve", Figure, "a curve")
    section.figure("broken", undrawable, "none")
    text = write_markdown(page, tmp_path / "page.md").read_text()
    assert [path.name for path in (tmp_path / "page").iterdir()] == ["curve.png"]
    assert "![a curve](page/curve.png)" in text
    assert "The figure `broken` could not be drawn: AttributeError" in text


@pytest.mark.parametrize(
    "text", [HOSTILE, "[a](javascript:alert(1))", "1. *a*\n\n# b_c_", "<script>", "a ``` b", "![x](y)"]
)
def test_hostile_text_stays_text(text: str) -> None:
    page = Page(text, text, text)
    section = page.section(text)
    section.text(text)
    section.terms({text: text})
    shown = rendered(markdown(page, "p"))
    assert not re.search(r"<(script|img|a|em|h3|ol)\b", shown)
    assert letters(words(shown)).count(letters(text)) >= 7
