"""A page that shows a study: sections of text, tables and figures in one HTML file that needs nothing else.

>>> page = Page("Capacity", "How many pairs fit into one hypervector.")
>>> section = page.section("Recall")
>>> section.table(Table("Recall", [Column("k"), Column("recall")]).show([{"k": 10, "recall": 1.0}]))
>>> "Recall" in page.html()
True
"""

from __future__ import annotations

import base64
import functools
import io
import re
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import jinja2
import pandas as pd
from markupsafe import Markup, escape

from behaviours.storage import write_atomically
from experiments.kit.columns import Column, Table
from experiments.kit.figures import drawn
from experiments.kit.pool import measured

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Column", "Page", "Section", "Table"]

_MIME = {b"\x89PNG": "image/png", b"GIF8": "image/gif"}


@dataclass(frozen=True)
class Block:
    """One thing on the page: `kind` names how the template shows `content`."""

    kind: str
    content: object
    caption: str = ""
    alt: str = ""
    data: str = ""
    file: str = ""
    """The name of the picture's file."""


@dataclass(frozen=True)
class Pending:
    """A picture that is still to be drawn: its file's name, the function that returns its bytes, its data as CSV."""

    name: str
    file: str
    draw: Callable[[], bytes]
    table: str = ""


@dataclass
class Section:
    """A part of the page under its own title; what is added to it appears in that order."""

    title: str
    page: Page
    blocks: list[Block] = field(default_factory=list)

    def text(self, *paragraphs: str) -> None:
        """Add paragraphs. Plain text; what stands between backticks is shown as code."""
        for paragraph in paragraphs:
            self.blocks.append(Block("text", paragraph))

    def table(self, table: Table) -> None:
        """Add a table with its caption, and the definitions of its columns below it."""
        self.blocks.append(Block("table", table, table.caption))
        self.terms({column.title: column.about for column in table.columns if column.about})

    def terms(self, definitions: Mapping[str, str]) -> None:
        """Add a list of words and what each of them means."""
        if definitions:
            self.blocks.append(Block("terms", list(definitions.items())))

    def picture(self, content: bytes, alt: str, caption: str = "", data: str = "") -> None:
        """Add a PNG or a GIF (which plays); `alt` says in words what it shows. Raises `ValueError` for other bytes."""
        self.blocks.append(self.page.picture(content, alt, caption, data))

    def figure(
        self, name: str, draw: Callable[[], Figure], alt: str, caption: str = "", data: pd.DataFrame | None = None
    ) -> None:
        """Add a figure that `draw` draws; it is kept as `figures/{name}.png`, with its `data` as CSV.

        It is drawn by `Page.draw`. One that cannot be drawn costs nothing else: the page says why, and `page.failures`
        holds the traceback.
        """
        table = "" if data is None else data.to_csv(index=False)
        pending = Pending(name, f"{name}.png", functools.partial(drawn, draw), table)
        self.blocks.append(Block("pending", pending, caption, alt))

    def animation(self, name: str, draw: Callable[[BinaryIO], None], alt: str, caption: str = "") -> None:
        """Add a GIF that `draw` writes to an open file; it is kept as `figures/{name}.gif`, see `figure`."""
        pending = Pending(name, f"{name}.gif", functools.partial(_written, draw))
        self.blocks.append(Block("pending", pending, caption, alt))

    def code(self, text: str, caption: str = "") -> None:
        """Add text to be copied: a command, settings."""
        self.blocks.append(Block("code", text, caption))


@dataclass
class Page:
    """The whole page; figures are kept in `folder` as well. The same content gives the same bytes."""

    title: str
    lead: str = ""
    headline: str = ""
    """The result in one sentence."""
    folder: Path | None = None
    sections: list[Section] = field(default_factory=list)
    failures: dict[str, str] = field(default_factory=dict)
    """The traceback of each figure that could not be drawn."""
    pictures: int = 0

    def section(self, title: str) -> Section:
        """Begin a new section."""
        section = Section(title, self)
        self.sections.append(section)
        return section

    def draw(self, workers: int = 1) -> None:
        """Draw all figures and animations that are still to be drawn, with so many processes."""
        waiting = [
            (section, place, block.content)
            for section in self.sections
            for place, block in enumerate(section.blocks)
            if isinstance(block.content, Pending)
        ]
        draws = [pending.draw for _, _, pending in waiting]
        # Another process takes as long to start as two figures to draw.
        workers = min(workers, -(-len(draws) // 2))
        found = dict(measured(_bytes_or_error, draws, range(len(draws)), workers)) if draws else {}
        for number, (section, place, pending) in enumerate(waiting):
            section.blocks[place] = self._drawn(section.blocks[place], pending, *found[number])

    def _drawn(self, block: Block, pending: Pending, content: bytes, error: str, trace: str) -> Block:
        """The picture that was drawn, kept in the folder; or why there is none."""
        if error:
            self.failures[pending.name] = trace
            return Block("text", f"The figure `{pending.name}` could not be drawn: {error}")
        if self.folder is not None:
            figures = self.folder / "figures"
            figures.mkdir(exist_ok=True)
            write_atomically(figures / pending.file, content)
            if pending.table:
                write_atomically(figures / f"{pending.name}.csv", pending.table.encode())
        link = f"data:text/csv;base64,{base64.b64encode(pending.table.encode()).decode()}" if pending.table else ""
        return replace(self.picture(content, block.alt, block.caption, link), file=pending.file)

    def picture(self, content: bytes, alt: str, caption: str = "", data: str = "") -> Block:
        """A block that shows a PNG or a GIF. Raises `ValueError` for other bytes."""
        mime = _MIME.get(content[:4])
        if mime is None:
            raise ValueError(f"picture {alt!r} starts with {content[:4]!r}; a page holds PNG and GIF only")
        self.pictures += 1
        image = self.pictures, f"data:{mime};base64,{base64.b64encode(content).decode()}"
        return Block("picture", image, caption, alt, data)

    def html(self) -> str:
        """The page as text, with all figures drawn; whatever was given is escaped."""
        self.draw()
        environment = jinja2.Environment(
            loader=jinja2.FileSystemLoader(Path(__file__).parent),
            autoescape=True,
            undefined=jinja2.StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        environment.filters["inline"] = _inline
        return environment.get_template("page.html").render(page=self)

    def write(self, path: Path) -> Path:
        """Write the page, whole or not at all."""
        return write_atomically(path, self.html().encode())


def _written(draw: Callable[[BinaryIO], None]) -> bytes:
    """What `draw` writes to a file."""
    buffer = io.BytesIO()
    draw(buffer)
    return buffer.getvalue()


def _bytes_or_error(draws: Sequence[Callable[[], bytes]], number: int) -> tuple[bytes, str, str]:
    """What one of them draws; or the error, and its traceback."""
    try:
        return draws[number](), "", ""
    except Exception as error:  # whatever it is, the results are worth more than one picture
        return b"", f"{type(error).__name__}: {error}", traceback.format_exc()


def _inline(text: str) -> Markup:
    # Escaped first, so the only tags are those put in here.
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))
