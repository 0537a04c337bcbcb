"""What is on a page, as tests see it."""

from html.parser import HTMLParser


class Elements(HTMLParser):
    """Tags with their attributes, and the visible text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def links(self) -> list[str]:
        """Everything that the page refers to."""
        return [value or "" for _, attrs in self.tags for key, value in attrs.items() if key in ("src", "href")]
