"""The page: safe, self-contained, and complete for any subset of the controllers."""

import base64
import io
from html.parser import HTMLParser
from pathlib import Path

import pytest
from PIL import Image
from small_run import report, small_run

from experiments import corral_tables, corral_text
from experiments.report import Cell, Page

HOSTILE = """</title><script>alert("1")</script><img src='https://a.org/x' onerror="alert(2)"> & `<b>{{ 7 * 7 }}`"""
TINY = Image.new("RGB", (3, 2), "red")


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


def png() -> bytes:
    buffer = io.BytesIO()
    TINY.save(buffer, "PNG")
    return buffer.getvalue()


def embedded(html: str) -> list[bytes]:
    return [base64.b64decode(link.split(",", 1)[1]) for link in Elements(html).links() if link.startswith("data:")]


def test_hostile_text_stays_text() -> None:
    page = Page(HOSTILE, HOSTILE)
    section = page.section(HOSTILE)
    section.text(HOSTILE)
    section.table([HOSTILE, HOSTILE], [[HOSTILE, Cell(HOSTILE, "best")]], HOSTILE)
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
    # Title twice, lead, section title twice, text, five in the table, two terms, picture's caption, code, its caption.
    assert "".join(seen.words).count("""<script>alert("1")</script>""") == 16
    assert "49" not in "".join(seen.words)


def test_backticks_become_code() -> None:
    page = Page("t")
    page.section("s").text("read `a < b` twice")
    assert "<p>read <code>a &lt; b</code> twice</p>" in page.html()


def test_what_does_not_fit_is_refused() -> None:
    section = Page("t").section("s")
    with pytest.raises(ValueError, match="row 'x' has 1 cells for 2 columns"):
        section.table(["a", "b"], [["x"]])
    with pytest.raises(ValueError, match="PNG and GIF only"):
        section.picture(b"<svg onload=alert(1)>", "drawing")


def test_pictures_come_back_as_they_were() -> None:
    page = Page("t")
    page.section("s").picture(png(), "red")
    assert embedded(page.html()) == [png()]


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("full")
    report(folder)
    return folder


def test_the_page_needs_nothing_else(full: Path) -> None:
    html = (full / "report.html").read_text()
    assert all(link.startswith(("data:image/", "#")) for link in Elements(html).links())
    assert {"script", "link", "iframe", "object"}.isdisjoint(tag for tag, _ in Elements(html).tags)
    assert "http://" not in html
    assert "https://" not in html
    assert "@import" not in html
    assert "url(" not in html
    assert len(html) < 8e6


def test_every_picture_decodes_and_lies_in_the_folder(full: Path) -> None:
    pictures = embedded((full / "report.html").read_text())
    files = [*(full / "figures").glob("*.png"), full / "rollout.gif"]
    assert sorted(pictures) == sorted(file.read_bytes() for file in files)
    assert len(pictures) == 6
    for content in pictures:
        with Image.open(io.BytesIO(content)) as image:
            image.load()
            assert image.width > 600
            if image.format == "GIF":
                assert getattr(image, "n_frames", 1) > 5


def test_the_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    for folder in (first, second):
        folder.mkdir()
        report(folder, "teacher", "hand_written")
    files = [file.relative_to(first) for file in first.rglob("*.*")]
    assert len(files) == 5
    for file in files:
        assert (first / file).read_bytes() == (second / file).read_bytes(), file


SECTIONS = {
    ("teacher", "default"): {"animation", "maps", "timeline", "corral", "fails"},
    ("random",): {"corral"},
    ("bundled",): {"maps", "timeline", "corral", "fails"},
    ("paper",): {"maps", "timeline", "corral", "fails", "paper"},
    ("nearest_neighbour",): {"fails"},
    ("teacher", "hand_written"): {"animation", "timeline", "corral", "fails"},
    ("teacher", "teacher_wheeled"): {"corral", "bodies"},
    ("teacher_wheeled",): set(),
}
TITLES = {
    "corral": "The corral from above",
    "animation": "Teacher and learned robot, side by side",
    "maps": "Agreement over sensor space",
    "timeline": "Similarity and familiarity over time",
    "paper": "Why the printed algorithm does what it does",
    "fails": "Where it fails",
    "bodies": "Wheeled and planar body",
}


@pytest.mark.parametrize("names", SECTIONS, ids="-".join)
def test_any_subset_of_controllers_has_its_sections(names: tuple[str, ...], tmp_path: Path) -> None:
    html = report(tmp_path, *names)
    wanted = {"What was run", "The table", "Success", "How to reproduce"} | {TITLES[key] for key in SECTIONS[names]}
    seen = Elements(html)
    headings = [attrs for tag, attrs in seen.tags if tag == "section"]
    assert len(headings) == len(wanted)
    assert wanted <= set(seen.words)
    assert (tmp_path / "rollout.gif").exists() == ("animation" in SECTIONS[names])


def test_the_animation_can_be_left_out(tmp_path: Path) -> None:
    assert "side by side" not in report(tmp_path, "teacher", "hand_written", animate=False)
    assert not (tmp_path / "rollout.gif").exists()


def test_the_page_shows_the_numbers_of_the_table(full: Path) -> None:
    words = Elements((full / "report.html").read_text()).words
    for row in small_run().results.table:
        at = words.index(row["controller"])
        interval = f"{row['success_rate']:.3f} [{row['success_low']:.3f}, {row['success_high']:.3f}]"
        assert words[at + 1 : at + 3] == [str(row["episodes"]), interval]


def test_marks_of_the_table() -> None:
    row = dict.fromkeys(("escape_rate", "dwell_fraction", "collision_fraction", "query_us"), 0.5)
    row |= {"episodes": 10, "success_low": 0.1, "success_high": 0.9, "pairs_stored": None, "bins": None}
    row |= {"train_agreement": 0.9, "heldout_agreement": 0.9, "unseen_agreement": None, "time_to_light_s": None}
    rows = [
        row | {"controller": "teacher", "success_rate": 1.0},
        row | {"controller": "default", "success_rate": 0.8, "time_to_light_s": 9.0},
        row | {"controller": "paper", "success_rate": 0.4, "time_to_light_s": 7.0},
    ]
    columns, table = corral_tables.main_table(rows)
    success, time = columns.index("success [95 %]"), columns.index("time (s)")
    assert [cells[success] for cells in table] == [
        Cell("1.000 [0.100, 0.900]"),
        Cell("0.800 [0.100, 0.900]", "best"),
        Cell("0.400 [0.100, 0.900]", "bad"),
    ]
    assert [cells[time] for cells in table] == [Cell("\u2013"), Cell("9.0"), Cell("7.0", "best")]


@pytest.mark.parametrize(
    ("share", "text"),
    [(0, "0 %"), (1, "100 %"), (0.5, "50 %"), (0.9996, "more than 99.9 %"), (0.0004, "less than 0.1 %")],
)
def test_a_share_is_never_rounded_to_all_or_none(share: float, text: str) -> None:
    assert corral_tables.percent(share) == text


def test_the_command_repeats_what_was_given(tmp_path: Path) -> None:
    assert corral_text.command(tmp_path) == "python -m experiments.corral"
    (tmp_path / ".hydra").mkdir()
    (tmp_path / ".hydra" / "overrides.yaml").write_text("- seed=1\n- controllers=[teacher,default]\n")
    assert corral_text.command(tmp_path) == "python -m experiments.corral seed=1 'controllers=[teacher,default]'"
