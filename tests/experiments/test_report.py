"""The page of the main job: complete for any subset of the controllers, and drawn again from its folder."""

import base64
import io
import shutil
from pathlib import Path

import pytest
from elements import Elements
from PIL import Image
from rich.console import Console
from small_run import full_run, small_run

from experiments.corral import tables
from experiments.corral.study import headline
from experiments.kit.run import draw, load


def embedded(html: str) -> list[bytes]:
    return [base64.b64decode(link.split(",", 1)[1]) for link in Elements(html).links() if link.startswith("data:")]


@pytest.fixture(scope="module")
def full() -> Path:
    return full_run().folder


def test_the_page_needs_nothing_else(full: Path) -> None:
    html = (full / "report.html").read_text()
    assert all(link.startswith(("data:", "#")) for link in Elements(html).links())
    assert {"script", "link", "iframe", "object"}.isdisjoint(tag for tag, _ in Elements(html).tags)
    assert "http://" not in html
    assert "https://" not in html
    assert "@import" not in html
    assert "url(" not in html
    assert len(html) < 8e6


def test_every_picture_decodes_and_lies_in_the_folder(full: Path) -> None:
    embeds = embedded((full / "report.html").read_text())
    pictures = [content for content in embeds if content.startswith((b"\x89PNG", b"GIF8"))]
    files = [*(full / "figures").glob("*.png"), full / "figures" / "rollout.gif"]
    assert sorted(pictures) == sorted(file.read_bytes() for file in files)
    assert len(pictures) == 6
    data = [*(full / "figures").glob("*.csv")]
    assert sorted(set(embeds) - set(pictures)) == sorted(file.read_bytes() for file in data)
    for content in pictures:
        with Image.open(io.BytesIO(content)) as image:
            image.load()
            assert image.width > 600
            if image.format == "GIF":
                assert getattr(image, "n_frames", 1) > 5


SECTIONS = {
    ("teacher", "default"): {"maps", "timeline", "corral", "fails"},
    ("random",): {"corral"},
    ("bundled",): {"maps", "timeline", "corral", "fails"},
    ("paper",): {"maps", "timeline", "corral", "fails", "paper"},
    ("nearest_neighbour",): {"fails"},
    ("teacher", "hand_written"): {"timeline", "corral", "fails"},
    ("teacher", "teacher_wheeled"): {"corral"},
    ("teacher_wheeled",): set(),
}
TITLES = {
    "corral": "The corral from above",
    "maps": "Agreement over sensor space",
    "timeline": "Similarity and familiarity over time",
    "paper": "Why the printed algorithm does what it does",
    "fails": "Where it fails",
}


def drawn_with(folder: Path, *names: str, **changed: object) -> str:
    """The page of the full run with only these controllers, drawn from a copy of its folder."""
    shutil.copytree(full_run().folder, folder, dirs_exist_ok=True)
    shutil.rmtree(folder / "figures")
    study, outcome = load(folder)
    outcome.settings.controllers = list(names)
    for name, value in changed.items():
        setattr(outcome.settings, name, value)
    outcome.table[:] = [row for row in outcome.table if row["controller"] in names]
    records = outcome.records[outcome.records.controller.isin(names)]
    object.__setattr__(outcome, "records", records)
    assert not draw(study, outcome, Console(quiet=True)).failures
    return (folder / "report.html").read_text()


@pytest.mark.parametrize("names", SECTIONS, ids="-".join)
def test_any_subset_of_controllers_has_its_sections(names: tuple[str, ...], tmp_path: Path) -> None:
    seen = Elements(drawn_with(tmp_path, *names))
    wanted = {"The table", "How to reproduce"} | {TITLES[key] for key in SECTIONS[names]}
    headings = [attrs for tag, attrs in seen.tags if tag == "section"]
    assert len(headings) == len(wanted)
    assert wanted <= set(seen.words)
    assert (tmp_path / "figures" / "rollout.gif").exists() == ("teacher" in names and "timeline" in SECTIONS[names])
    assert any("wheels on a floor" in word for word in seen.words) == ("teacher_wheeled" in names)


def test_the_animation_can_be_left_out(tmp_path: Path) -> None:
    assert "Animation of teacher" not in drawn_with(tmp_path, "teacher", "hand_written", animate=False)
    assert not (tmp_path / "figures" / "rollout.gif").exists()


def test_the_same_settings_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("first", "second"):
        small_run(tmp_path / name, "controllers=[teacher,hand_written]")
    files = [path.relative_to(tmp_path / "first") for path in (tmp_path / "first").rglob("*.*") if path.is_file()]
    names = {path.as_posix() for path in files}
    assert {"figures/success.png", "figures/trajectories.png", "figures/timelines.png", "figures/rollout.gif"} <= names
    # Those with times of the clock in them.
    timed = {"report.html", "results.json", "records.parquet", "cells.jsonl", "figures/success.csv"}
    for name in names - timed:
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes(), name


def test_a_page_that_is_drawn_again_is_the_same(full: Path, tmp_path: Path) -> None:
    shutil.copytree(full, tmp_path, dirs_exist_ok=True)
    (tmp_path / "report.html").unlink()
    study, outcome = load(tmp_path)
    draw(study, outcome, Console(quiet=True))
    assert (tmp_path / "report.html").read_bytes() == (full / "report.html").read_bytes()


def test_the_page_shows_the_numbers_of_the_table(full: Path) -> None:
    words = Elements((full / "report.html").read_text()).words
    # Headline and text name controllers too.
    words = words[words.index("controller") :]
    for row in full_run().table:
        at = words.index(row["controller"])
        interval = f"{row['success_rate']:.3f} [{row['success_low']:.3f}, {row['success_high']:.3f}]"
        assert words[at + 1 : at + 3] == [str(row["episodes"]), interval]


def test_success_is_marked_only_on_the_starts_that_all_drove() -> None:
    rows = [
        {"controller": name, "episodes": episodes, "success_rate": rate, "common_rate": rate, "time_to_light_s": time}
        for name, episodes, rate, time in (("teacher", 9, 1.0, 5.0), ("default", 9, 0.8, 9.0), ("paper", 4, 0.4, 7.0))
    ]
    table = tables.MAIN.show(rows)
    marks = {column.title: [row[place].mark for row in table.cells] for place, column in enumerate(table.columns)}
    assert marks["success [95 %]"] == ["", "", "bad"]
    assert marks["common"] == ["", "best", ""]
    assert marks["time"] == ["", "", ""]
    alike = tables.MAIN.show([{**row, "episodes": 4} for row in rows])
    place = [column.title for column in alike.columns].index("time")
    assert [row[place].mark for row in alike.cells] == ["", "", "best"]


def test_the_headline_says_what_the_table_says() -> None:
    rows = {row["controller"]: row for row in full_run().table}
    words = headline(full_run())
    assert words.startswith("One hypervector of 600 numbers drives the robot to the lamp from ")
    for name, before in (("default", "lamp from "), ("paper", "; `paper` from ")):
        assert f"{before}{rows[name]['success_rate'] * 8:.0f} of 8 starts" in words
