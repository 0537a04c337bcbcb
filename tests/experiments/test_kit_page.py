"""The page of a study: safe, self-contained, and drawn from what it is given."""

import base64
import functools
import io
from pathlib import Path
from typing import BinaryIO

import pandas as pd
import pytest
from elements import Elements
from matplotlib.figure import Figure
from PIL import Image

from experiments.kit import Column, Page, Table

HOSTILE = """</title><script>alert("1")</script><img src='https://a.org/x' onerror="alert(2)"> & `<b>{{ 7 * 7 }}`"""
TINY = Image.new("RGB", (3, 2), "red")


def png() -> bytes:
    buffer = io.BytesIO()
    TINY.save(buffer, "PNG")
    return buffer.getvalue()


def embedded(html: str) -> list[bytes]:
    return [base64.b64decode(link.split(",", 1)[1]) for link in Elements(html).links() if link.startswith("data:")]


def test_hostile_text_stays_text() -> None:
    page = Page(HOSTILE, HOSTILE, HOSTILE)
    section = page.section(HOSTILE)
    section.text(HOSTILE)
    columns = [Column("a", HOSTILE), Column("b", HOSTILE)]
    section.table(Table(HOSTILE, columns, HOSTILE).show([{"a": HOSTILE, "b": HOSTILE}]))
    section.terms({HOSTILE: HOSTILE})
    section.picture(png(), HOSTILE, HOSTILE)
    section.code(HOSTILE, HOSTILE)
    seen = Elements(page.html())
    assert {"script", "b"}.isdisjoint(tag for tag, _ in seen.tags)
    assert [tag for tag, _ in seen.tags].count("img") == 1
    assert not any(key.startswith("on") for _, attrs in seen.tags for key in attrs)
    assert all(link.startswith(("data:", "#")) for link in seen.links())
    alts = [attrs["alt"] for tag, attrs in seen.tags if tag == "img"]
    assert alts == [HOSTILE]
    # Title twice, lead, headline, section title twice, text, five in the table, two terms, caption, code, caption.
    assert "".join(seen.words).count("""<script>alert("1")</script>""") == 17
    assert "49" not in "".join(seen.words)


def test_backticks_become_code() -> None:
    page = Page("t")
    page.section("s").text("read `a < b` twice")
    assert "<p>read <code>a &lt; b</code> twice</p>" in page.html()


def test_what_is_no_picture_is_refused() -> None:
    with pytest.raises(ValueError, match="PNG and GIF only"):
        Page("t").section("s").picture(b"<svg onload=alert(1)>", "drawing")


def test_pictures_come_back_as_they_were() -> None:
    page = Page("t")
    page.section("s").picture(png(), "red")
    assert embedded(page.html()) == [png()]


ROWS = [
    {"name": "teacher", "rate": 1.0, "time": 5.0, "starts": 10},
    {"name": "first", "rate": 0.8, "time": 9.0, "starts": 10},
    {"name": "second", "rate": 0.4, "time": None, "starts": 10},
]


def marks(column: Column, rows: list[dict[str, object]]) -> list[str]:
    return [cell.mark for cell in column.cells(rows)]


def test_the_best_of_those_that_compete_is_marked_where_they_compare() -> None:
    rate = Column("rate", best="max", among=lambda row: row["name"] != "teacher", alike="starts", bad=lambda x: x < 0.5)
    assert marks(rate, ROWS) == ["", "best", "bad"]
    assert marks(rate, [{**ROWS[0], "starts": 99}, *ROWS[1:]]) == ["", "best", "bad"]
    assert marks(rate, [*ROWS[:2], {**ROWS[2], "starts": 99}]) == ["", "", "bad"]
    assert marks(Column("time", best="min"), ROWS) == ["best", "", ""]
    assert [cell.text for cell in Column("time", format=".1f").cells(ROWS)] == ["5.0", "9.0", "-"]


def test_pictures_are_drawn_alike_by_any_number_of_processes(tmp_path: Path) -> None:
    def fails() -> Figure:
        raise RuntimeError("no ink")

    def page(folder: Path, workers: int) -> Page:
        folder.mkdir()
        made = Page("t", folder=folder)
        section = made.section("s")
        for number in range(3):
            data = pd.DataFrame({"x": [number]})
            section.figure(f"line{number}", functools.partial(line, number), "a line", data=data)
        section.figure("broken", fails, "nothing")
        section.animation("moving", moves, "moves")
        made.draw(workers)
        return made

    def moves(file: BinaryIO) -> None:
        file.write(b"GIF89a and more")

    def line(slope: float) -> Figure:
        figure = Figure(figsize=(1, 1))
        figure.subplots().plot([0, slope])
        return figure

    one, two = page(tmp_path / "one", 1), page(tmp_path / "two", 2)
    assert one.html() == two.html()
    assert "The figure <code>broken</code> could not be drawn: RuntimeError: no ink" in one.html()
    assert list(one.failures) == ["broken"]
    names = {path.name for path in (tmp_path / "two" / "figures").iterdir()}
    assert names == {"line0.png", "line0.csv", "line1.png", "line1.csv", "line2.png", "line2.csv", "moving.gif"}
    assert (tmp_path / "one" / "figures" / "moving.gif").read_bytes() == b"GIF89a and more"
    assert b"GIF89a and more" in embedded(one.html())
