"""A page as Markdown, with its pictures beside it: for a README, an issue, or a site of documentation.

>>> from experiments.kit.page import Page
>>> page = Page("Capacity", "How many pairs fit into one hypervector?")
>>> page.section("Recall").text("Ten of `k * 2` pairs.")
>>> print(markdown(page, "capacity"))
# Capacity
<BLANKLINE>
How many pairs fit into one hypervector?
<BLANKLINE>
## Recall
<BLANKLINE>
Ten of `k * 2` pairs.
<BLANKLINE>
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

from behaviours.storage import write_atomically
from experiments.kit.page import Block, Page, Table


def write_markdown(page: Page, path: Path) -> Path:
    """Write the page to `path`, and its pictures to the folder of that name without the suffix."""
    page.draw()
    folder = path.with_suffix("")
    if page.pictures:
        folder.mkdir(parents=True, exist_ok=True)
    for block in _blocks(page):
        if block.kind == "picture":
            write_atomically(folder / _file(block), base64.b64decode(_image(block)[1].partition(",")[2]))
    return write_atomically(path, markdown(page, folder.name).encode())


def markdown(page: Page, pictures: str) -> str:
    """The page as text; its pictures are in the folder `pictures`."""
    parts = [f"# {escaped(page.title)}"]
    parts += [escaped(page.lead)] if page.lead else []
    parts += [f"**{escaped(page.headline)}**"] if page.headline else []
    for section in page.sections:
        parts.append(f"## {escaped(section.title)}")
        for block in section.blocks:
            parts += _parts(block, pictures)
    return "\n\n".join(parts) + "\n"


def escaped(text: str) -> str:
    """Plain text as Markdown that shows it; what stands between backticks stays code."""
    parts = re.split(r"(`[^`]+`)", " ".join(text.split()))
    return "".join(part if place % 2 else _plain(part) for place, part in enumerate(parts))


def _plain(text: str) -> str:
    return re.sub(r"([\\`*_<>\[\]#|~$&!]|^[-+]|^\d+(?=[.)]))", r"\\\1", text)


def _parts(block: Block, pictures: str) -> Iterator[str]:
    caption = escaped(block.caption)
    if block.kind == "picture":
        yield f"![{escaped(block.alt)}]({quote(pictures)}/{quote(_file(block))})"
        yield from [caption] if caption else []
    elif block.kind == "table":
        assert isinstance(block.content, Table)
        yield block.content.markdown()
        yield from [caption] if caption else []
    elif block.kind == "terms":
        assert isinstance(block.content, list)
        yield "\n".join(f"- {escaped(term)}: {escaped(meaning)}" for term, meaning in block.content)
    elif block.kind == "code":
        yield from [caption] if caption else []
        text = str(block.content)
        fence = "`" * max(3, 1 + max((len(ticks) for ticks in re.findall("`+", text)), default=0))
        yield f"{fence}text\n{text.rstrip()}\n{fence}"
    else:
        yield escaped(str(block.content))


def _blocks(page: Page) -> Iterator[Block]:
    return (block for section in page.sections for block in section.blocks)


def _image(block: Block) -> tuple[int, str]:
    image = block.content
    assert isinstance(image, tuple)
    return image


def _file(block: Block) -> str:
    number, uri = _image(block)
    return block.file or f"figure_{number}.{uri.partition(';')[0].rpartition('/')[2]}"
