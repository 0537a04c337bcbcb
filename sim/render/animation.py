"""Animations: the path of one episode of several robots side by side, as a GIF."""

from __future__ import annotations

import io
import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import matplotlib
import matplotlib.colors
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from sim.arena import Arena
from sim.render.pictures import COLOURS, INK, LAMPS, PAPER, WALL, extent
from sim.result import Rollout, Steps
from sim.robot import CONTROL_HZ, RADIUS
from sim.sensors import DISTANCE_MAX, LIGHT_MAX
from sim.shapes import Box
from sim.task import Task
from sim.teachers import BEHAVIOURS, InOrder


def animate(
    rollouts: Sequence[Rollout],
    titles: Sequence[str],
    path: str | os.PathLike[str] | BinaryIO,
    episode: int | None = None,
    speed: float = 2.0,
    frames: int = 150,
) -> None:
    """Write a GIF of one episode of several rollouts side by side, with trails and the time.

    Shows the robot's outline, its lit light sensors and its distance beam, from the recorded readings. The file is
    written atomically.

    Args:
        rollouts: recorded rollouts in the same arena.
        titles: one per rollout.
        path: the file to write, whose folder must exist; or an open binary file.
        episode: its number; by default the one of median length among those that succeed in the most rollouts.
        speed: playback speed relative to real time.
        frames: maximum number of frames; a longer episode is drawn in larger steps.

    Raises:
        ValueError: not one title per rollout, different arenas, no common episode, or numbers out of range.
        KeyError: the episode is missing in a rollout, or was not recorded.
    """
    if not rollouts or len(rollouts) != len(titles):
        raise ValueError(f"{len(rollouts)} rollouts and {len(titles)} titles; expected one title per rollout")
    if len({rollout.arena for rollout in rollouts}) > 1:
        raise ValueError("the rollouts are from different arenas; expected one arena")
    chosen = typical(rollouts) if episode is None else episode
    panels = [
        _Panel(rollout.slice(chosen), title, rollout.arena, rollout.task)
        for rollout, title in zip(rollouts, titles, strict=True)
    ]
    _write_gif(panels, path, speed, frames)


def animate_steps(
    steps: Steps,
    title: str,
    path: str | os.PathLike[str] | BinaryIO,
    arena: Arena,
    speakers: Sequence[str],
    task: Task | None = None,
    colours: Mapping[str, str] = COLOURS,
    speed: float = 2.0,
    frames: int = 150,
) -> None:
    """Write a GIF of the recorded steps of one episode, as `animate` does, with the behaviour that speaks at each.

    Args:
        steps: the control steps.
        title: written above the picture.
        path: the file to write, whose folder must exist; or an open binary file.
        arena: where the robot drove.
        speakers: a name for each step: what is written below the picture, and says the colour.
        task: says what the columns of the readings are; by default that of the arena.
        colours: of the names; others are dark.
        speed: playback speed relative to real time.
        frames: maximum number of frames.

    Raises:
        ValueError: not one speaker per step, no steps, or numbers out of range.
    """
    if len(steps) != len(speakers) or not len(steps):
        raise ValueError(f"{len(steps)} steps and {len(speakers)} speakers; expected one speaker per step")
    panel = _Panel(steps, title, arena, Task.of(arena) if task is None else task, speakers, colours)
    _write_gif([panel], path, speed, frames)


def _write_gif(panels: Sequence[_Panel], path: str | os.PathLike[str] | BinaryIO, speed: float, frames: int) -> None:
    if speed <= 0 or frames < 1:
        raise ValueError(f"speed={speed}, frames={frames}; expected a speed above 0 and at least 1 frame")
    length = max(len(panel) for panel in panels)
    # Two control steps per frame look smooth. Viewers slow down a GIF with less than 20 ms per frame.
    stride = max(2, -(-length // frames), math.ceil(speed * 0.02 * CONTROL_HZ))
    ticks = [*range(0, length - 1, stride), length - 1]
    images = [_join([panel.frame(tick) for panel in panels], speed) for tick in ticks]
    palette = images[-1].quantize(128)
    images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    delay = round(1000 * stride / CONTROL_HZ / speed)
    buffer = io.BytesIO()
    images[0].save(
        buffer, "GIF", save_all=True, append_images=images[1:], loop=0, optimize=False,
        duration=[delay] * (len(images) - 1) + [1500],
    )  # fmt: skip
    if isinstance(path, str | os.PathLike):
        _write(Path(path), buffer.getvalue())
    else:
        path.write(buffer.getvalue())


def typical(rollouts: Sequence[Rollout]) -> int:
    """The episode of median length among the common ones that succeed in the most rollouts."""
    common = sorted(set.intersection(*(set(rollout.episode.tolist()) for rollout in rollouts)))
    if not common:
        raise ValueError("the rollouts have no episode in common")
    scored = []
    for episode in common:
        rows = [int(np.flatnonzero(rollout.episode == episode)[0]) for rollout in rollouts]
        wins = sum(bool(rollout.success[row]) for rollout, row in zip(rollouts, rows, strict=True))
        steps = max(int(rollout.steps[row]) for rollout, row in zip(rollouts, rows, strict=True))
        scored.append((wins, steps, episode))
    best = max(wins for wins, *_ in scored)
    lengths = sorted((steps, episode) for wins, steps, episode in scored if wins == best)
    return lengths[(len(lengths) - 1) // 2][1]


_BEHAVIOUR_OF_RULE = {rule: name for name, rules in BEHAVIOURS.items() for rule in rules}


class _Panel:
    """The picture of one robot, drawn `_FINE` times larger and scaled down to smooth all edges."""

    _WIDTH, _FINE, _HEAD, _FOOT = 400, 2, 34, 24

    def __init__(
        self,
        path: Steps,
        title: str,
        arena: Arena,
        task: Task,
        speakers: Sequence[str] | None = None,
        colours: Mapping[str, str] = COLOURS,
    ) -> None:
        self._path = path
        self._title = title
        if speakers is None:
            speakers = [_BEHAVIOUR_OF_RULE[rule] for rule in InOrder(task).rule(path.sensors, path.goal).tolist()]
        self._speakers = list(speakers)
        self._colours = [colours.get(name, INK) for name in self._speakers]
        self._lights = [task.pair(task.goals[goal]) for goal in path.goal.tolist()]
        left, right, bottom, top = extent(arena)
        self._scale = self._WIDTH * self._FINE / (right - left)
        self._origin = left, top
        size = self._WIDTH * self._FINE, round((top - bottom) * self._scale)
        self._trail = Image.new("RGB", size, PAPER)
        self._drawn = 0
        pen = ImageDraw.Draw(self._trail)
        for lamp in arena.lamps:
            for scale, share in ((3.2, 0.1), (2.3, 0.25), (1.6, 0.5), (1.0, 1.0)):
                light = LAMPS.get(lamp.colour, PAPER)
                self._disc(pen, lamp.x, lamp.y, scale * lamp.radius, fill=_mixed(light, share))
        for shape in arena.obstacles:
            if isinstance(shape, Box):
                (left, right), (low, high) = (
                    (at - half, at + half) for at, half in ((shape.x, shape.half_x), (shape.y, shape.half_y))
                )
                pen.rectangle([self._at(left, high), self._at(right, low)], fill=WALL)
            else:
                self._disc(pen, shape.x, shape.y, shape.radius, fill=WALL)
        self._disc(pen, float(path.x[0]), float(path.y[0]), 0.05, fill=PAPER, outline=INK, width=2 * self._FINE)

    def __len__(self) -> int:
        return len(self._path)

    def frame(self, tick: int) -> Image.Image:
        """The picture at control step `tick`; after its last step a robot stays where it ended."""
        tick = min(tick, len(self) - 1)
        path = self._path
        pen = ImageDraw.Draw(self._trail)
        for i in range(self._drawn, tick):
            ends = [self._at(path.x[k], path.y[k]) for k in (i, i + 1)]
            pen.line(ends, fill=self._colours[i], width=2 * self._FINE)
            if self._speakers[i] == "avoid":
                self._disc(pen, float(path.x[i]), float(path.y[i]), 0.035, fill=COLOURS["avoid"])
        self._drawn = max(self._drawn, tick)
        image = self._trail.copy()
        self._robot(ImageDraw.Draw(image), tick)
        image = image.reduce(self._FINE)
        framed = Image.new("RGB", (image.width, image.height + self._HEAD + self._FOOT), PAPER)
        framed.paste(image, (0, self._HEAD))
        text = ImageDraw.Draw(framed)
        text.text((12, 9), self._title, fill=INK, font=_font(17, bold=True))
        clock = f"{tick / CONTROL_HZ:4.1f} s"
        text.text((image.width - 12, 10), clock, fill=INK, font=_font(16), anchor="ra")
        note = "at the lamp" if path.at_lamp[tick] else self._speakers[tick].replace("_", " ")
        text.text((12, framed.height - 26), note, fill=self._colours[tick], font=_font(14, bold=True))
        return framed

    def _robot(self, pen: ImageDraw.ImageDraw, tick: int) -> None:
        x, y, heading = (float(column[tick]) for column in (self._path.x, self._path.y, self._path.heading))
        readings = self._path.sensors[tick].tolist()
        (left, right), distance = (readings[column] for column in self._lights[tick]), readings[-1]
        ahead = np.array([np.cos(heading), np.sin(heading)])
        aside = np.array([-ahead[1], ahead[0]])
        here = np.array([x, y])
        if distance < DISTANCE_MAX:
            ends = [self._at(*(here + reach * ahead)) for reach in (RADIUS, RADIUS + distance)]
            pen.line(ends, fill=COLOURS["avoid"], width=2 * self._FINE)
        self._disc(pen, x, y, RADIUS, fill=self._colours[tick], outline=INK, width=self._FINE)
        nose = [self._at(*(here + RADIUS * (a * ahead + b * aside))) for a, b in ((0.8, 0), (0.1, 0.4), (0.1, -0.4))]
        pen.polygon(nose, fill=PAPER)
        for reading, side in ((left, 1.0), (right, -1.0)):
            eye_x, eye_y = (here + RADIUS * (0.5 * ahead + 0.87 * side * aside)).tolist()
            lit = reading < LIGHT_MAX
            self._disc(pen, eye_x, eye_y, 0.05, fill="#ffd21f" if lit else "#9aa3af", outline=INK, width=self._FINE)

    def _at(self, x: float, y: float) -> tuple[float, float]:
        return (float(x) - self._origin[0]) * self._scale, (self._origin[1] - float(y)) * self._scale

    def _disc(self, pen: ImageDraw.ImageDraw, x: float, y: float, radius: float, **style: object) -> None:
        (u, v), r = self._at(x, y), radius * self._scale
        pen.ellipse([u - r, v - r, u + r, v + r], **style)  # pyright: ignore[reportArgumentType]


def _mixed(colour: str, share: float) -> tuple[int, int, int]:
    """A colour mixed with white."""
    red, green, blue = (round(255 + share * (255 * channel - 255)) for channel in matplotlib.colors.to_rgb(colour))
    return red, green, blue


def _join(frames: Sequence[Image.Image], speed: float) -> Image.Image:
    gap = 8
    width = sum(frame.width for frame in frames) + gap * (len(frames) - 1)
    joined = Image.new("RGB", (width, max(frame.height for frame in frames)), "#d5d9df")
    left = 0
    for frame in frames:
        joined.paste(frame, (left, 0))
        left += frame.width + gap
    pen = ImageDraw.Draw(joined)
    pen.text((width - 12, joined.height - 26), f"{speed:g}x", fill="#7b8494", font=_font(14), anchor="ra")
    return joined


def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name, size)


def _write(path: Path, content: bytes) -> None:
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
