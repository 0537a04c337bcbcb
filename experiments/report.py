"""A page that shows a study: sections of text, tables and pictures in one HTML file that needs nothing else.

>>> page = Page("Capacity", "How many pairs fit into one hypervector.")
>>> section = page.section("Recall")
>>> section.table(["k", "recall"], [["10", "1.00"], ["50", "0.93"]])
>>> "Recall" in page.html()
True
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import jinja2
from markupsafe import Markup, escape
from omegaconf import OmegaConf

from behaviours.storage import write_atomically

_MIME = {b"\x89PNG": "image/png", b"GIF8": "image/gif"}


@dataclass(frozen=True)
class Cell:
    """One cell of a table; `mark` says whether it stands out, and how."""

    text: str
    mark: Literal["", "best", "bad"] = ""


@dataclass(frozen=True)
class Block:
    """One thing on the page: `kind` names how the template shows `content`."""

    kind: str
    content: object
    caption: str = ""
    alt: str = ""


@dataclass
class Section:
    """A part of the page under its own title; what is added to it appears in that order."""

    title: str
    blocks: list[Block] = field(default_factory=list)

    def text(self, *paragraphs: str) -> None:
        """Add paragraphs. Plain text; what stands between backticks is shown as code."""
        for paragraph in paragraphs:
            self.blocks.append(Block("text", paragraph))

    def table(
        self, columns: Sequence[str], rows: Iterable[Sequence[str | Cell]], caption: str = "", words: bool = False
    ) -> None:
        """Add a table; the first column names its rows, the others hold numbers unless they hold `words`.

        Raises `ValueError` for a row of another length.
        """
        cells = [[cell if isinstance(cell, Cell) else Cell(cell) for cell in row] for row in rows]
        for row in cells:
            if len(row) != len(columns):
                raise ValueError(
                    f"table {caption or self.title!r}: row {row[0].text if row else ''!r} has {len(row)} cells "
                    f"for {len(columns)} columns"
                )
        self.blocks.append(Block("table", (columns, cells, words), caption))

    def terms(self, definitions: Mapping[str, str]) -> None:
        """Add a list of words and what each of them means."""
        self.blocks.append(Block("terms", list(definitions.items())))

    def picture(self, content: bytes, alt: str, caption: str = "") -> None:
        """Add a PNG or a GIF (which plays); `alt` says in words what it shows. Raises `ValueError` for other bytes."""
        mime = _MIME.get(content[:4])
        if mime is None:
            raise ValueError(f"picture {alt!r} starts with {content[:4]!r}; a page holds PNG and GIF only")
        self.blocks.append(Block("picture", f"data:{mime};base64,{base64.b64encode(content).decode()}", caption, alt))

    def code(self, text: str, caption: str = "") -> None:
        """Add text to be copied: a command, settings."""
        self.blocks.append(Block("code", text, caption))


@dataclass
class Page:
    """The whole page. The same content gives the same bytes."""

    title: str
    lead: str = ""
    sections: list[Section] = field(default_factory=list)

    def section(self, title: str) -> Section:
        """Begin a new section."""
        section = Section(title)
        self.sections.append(section)
        return section

    def how_to_reproduce(self, config: Mapping[str, Any], *commands: str) -> None:
        """End with what it takes to run the same again: commands, if any, and all settings."""
        section = self.section("How to reproduce")
        section.text("The same settings give the same numbers, times aside.")
        for command in commands:
            section.code(command)
        section.code(OmegaConf.to_yaml(OmegaConf.create(dict(config))), "All settings of this run:")

    def html(self) -> str:
        """The page as text; whatever was given is escaped."""
        folder = Path(__file__).parent
        environment = jinja2.Environment(
            loader=jinja2.FileSystemLoader(folder),
            autoescape=True,
            undefined=jinja2.StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        environment.filters["inline"] = _inline
        return environment.get_template("report.html").render(page=self)

    def write(self, path: Path) -> Path:
        """Write the page, whole or not at all."""
        return write_atomically(path, self.html().encode())


def _inline(text: str) -> Markup:
    # Escaped first, so the only tags are those put in here.
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))
