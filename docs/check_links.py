"""Check the site that was built: `python docs/check_links.py docs/_build/html`.

Every link within the site leads to a page, and to a part of it that exists; and no page loads anything from elsewhere,
so that the site works from a folder without a network. Prints what is wrong, and exits with 1 if anything is.
"""

import sys
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {"img": "src", "script": "src", "link": "href", "iframe": "src", "source": "src", "video": "src"}
"""Elements that make a browser fetch something, and the attribute that says what."""


@dataclass
class Parts(HTMLParser):
    """What a page links to, what it loads, and the names of its parts."""

    links: list[str] = field(default_factory=list)
    loaded: list[str] = field(default_factory=list)
    names: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note the element."""
        given = {key: value or "" for key, value in attrs}
        self.names |= {given[key] for key in ("id", "name") if key in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag in LOADED and given.get(LOADED[tag]):
            self.loaded.append(given[LOADED[tag]])


def problems(site: Path) -> list[str]:
    """What is wrong with the pages below a folder, a line for each."""
    pages = {}
    for path in sorted(site.rglob("*.html")):
        pages[path.resolve()] = parts = Parts()
        parts.feed(path.read_text())
    found = [] if pages else [f"{site} has no pages"]
    for path, parts in pages.items():
        name = path.relative_to(site.resolve())
        for link in parts.loaded:
            split = urlsplit(link)
            if split.scheme not in ("", "data") or split.netloc:
                found.append(f"{name} loads {link}")
            elif not split.scheme and not (path.parent / unquote(split.path)).exists():
                found.append(f"{name} loads {link}, which is not there")
        for link in parts.links:
            split = urlsplit(link)
            if split.scheme or split.netloc:
                continue
            target = (path.parent / unquote(split.path)).resolve() if split.path else path
            if not target.exists():
                found.append(f"{name} links to {link}, which is not there")
            elif split.fragment and target in pages and unquote(split.fragment) not in pages[target].names:
                found.append(f"{name} links to {link}; that page has no such part")
    return found


if __name__ == "__main__":
    wrong = problems(Path(sys.argv[1]))
    print("\n".join(wrong) or "all links lead somewhere, and nothing is loaded from elsewhere")
    sys.exit(bool(wrong))
