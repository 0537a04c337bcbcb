import dataclasses
import io
from pathlib import Path

import matplotlib as mpl
import numpy as np
import policies
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

import sim
from sim import render
from sim.result import Rollout

mpl.use("Agg")


@pytest.fixture(scope="module")
def pair() -> tuple[Rollout, Rollout]:
    run = {"episodes": range(5), "seed": 2}
    return sim.rollout(sim.Teacher(), **run), sim.rollout(policies.random, **run, seconds=5.0)


def test_the_corral_is_drawn_to_scale() -> None:
    ax = Figure().subplots()
    render.draw_corral(ax, sim.corral())
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert left < -1.5 < 2.3 + 0.15 < right
    assert bottom < -1.5 < 1.5 < top
    assert ax.get_aspect() == 1.0


def test_trajectories_are_drawn_where_they_were(pair: tuple[Rollout, Rollout]) -> None:
    ax = Figure().subplots()
    render.draw_rollout(ax, pair[0], episodes=[3, 1])
    lines = [drawn for drawn in ax.collections if isinstance(drawn, LineCollection)]
    assert len(lines) == 2
    path = pair[0].slice(3)
    segments = lines[0].get_segments()
    assert len(segments) == len(path) - 1
    assert segments[10].tolist() == [[path.x[10], path.y[10]], [path.x[11], path.y[11]]]


def test_failures_are_marked(pair: tuple[Rollout, Rollout]) -> None:
    marks = []
    for rollout in pair:
        ax = Figure().subplots()
        render.draw_rollout(ax, rollout, legend=False)
        marks.append(sum(line.get_marker() == "X" for line in ax.lines))
    assert marks == [0, 5]


def test_the_animation(pair: tuple[Rollout, Rollout], tmp_path: Path) -> None:
    path = tmp_path / "a.gif"
    render.animate(pair, ["teacher", "random"], path, episode=1)
    assert [file.name for file in tmp_path.iterdir()] == ["a.gif"]
    assert path.stat().st_size < 3_000_000
    with Image.open(path) as gif:
        frames = getattr(gif, "n_frames", 1)
        steps = max(len(rollout.slice(1)) for rollout in pair)
        stride = max(2, -(-steps // 150))
        assert frames == pytest.approx(steps / stride, abs=2)
        first = np.asarray(gif.convert("RGB")).astype(int)
        gif.seek(frames - 1)
        last = np.asarray(gif.convert("RGB")).astype(int)
    half = first.shape[1] // 2
    assert np.abs(first - last)[:, :half].max() > 100
    assert np.abs(first - last)[:, half:].max() > 100


def test_an_animation_shows_who_speaks(pair: tuple[Rollout, Rollout], tmp_path: Path) -> None:
    steps, arena = pair[0].slice(1), pair[0].arena
    last = {}
    for name in ("avoid", "cruise"):
        file = io.BytesIO()
        render.animate_steps(steps, "one", file, arena, [name] * len(steps), frames=10)
        with Image.open(file) as gif:
            gif.seek(getattr(gif, "n_frames", 1) - 1)
            last[name] = np.asarray(gif.convert("RGB")).astype(int).reshape(-1, 3)
    colours = {name: np.array(to_rgb(render.COLOURS[name])) * 255 for name in last}
    for name, pixels in last.items():
        near = {other: (np.abs(pixels - colour).max(1) < 12).sum() for other, colour in colours.items()}
        assert near[name] > 5 * near["cruise" if name == "avoid" else "avoid"]
    with pytest.raises(ValueError, match="one speaker per step"):
        render.animate_steps(steps, "one", tmp_path / "d.gif", arena, ["avoid"])


def test_the_animation_of_the_most_typical_episode(pair: tuple[Rollout, Rollout]) -> None:
    lengths = {int(e): int(s) for e, s in zip(pair[0].episode, pair[0].steps, strict=True)}
    assert lengths[render.typical([pair[0]])] == sorted(lengths.values())[2]
    one_wins = dataclasses.replace(pair[0], success=np.array([False, False, False, True, False]))
    assert render.typical([pair[0], one_wins]) == 3


def test_a_long_episode_is_drawn_in_larger_steps(pair: tuple[Rollout, Rollout], tmp_path: Path) -> None:
    render.animate(pair[:1], ["one"], tmp_path / "b.gif", frames=20)
    with Image.open(tmp_path / "b.gif") as gif:
        assert getattr(gif, "n_frames", 1) <= 21


def test_misuse_is_named_and_leaves_no_file(pair: tuple[Rollout, Rollout], tmp_path: Path) -> None:
    path = tmp_path / "c.gif"
    with pytest.raises(ValueError, match="one title per rollout"):
        render.animate(pair, ["teacher"], path)
    with pytest.raises(ValueError, match="different arenas"):
        render.animate([pair[0], dataclasses.replace(pair[1], arena=sim.find_arena("large"))], ["a", "b"], path)
    with pytest.raises(ValueError, match="speed=0"):
        render.animate(pair, ["a", "b"], path, speed=0)
    with pytest.raises(KeyError, match="episode 77"):
        render.animate(pair, ["a", "b"], path, episode=77)
    with pytest.raises(ValueError, match="no episode in common"):
        render.animate([pair[0], dataclasses.replace(pair[1], episode=pair[1].episode + 50)], ["a", "b"], path)
    with pytest.raises(FileNotFoundError):
        render.animate(pair, ["a", "b"], tmp_path / "missing" / "c.gif")
    assert list(tmp_path.iterdir()) == []
