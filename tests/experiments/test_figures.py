"""What the figures show, against direct computations on a tiny run."""

import io
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
import torch
from PIL import Image
from small_run import STARTS, held_out, material, one_thread, program, rollout, settings

import sim
from behaviours import Demonstrations
from experiments.corral import figures
from experiments.corral.command_map import (
    COMMANDS,
    DISTANCE,
    LEFT,
    RIGHT,
    SLICES,
    Slice,
    ambiguous_share,
    command_map,
    kinds,
)
from experiments.corral.forgetting import (
    CLIPPED,
    DEFAULT,
    MEAN,
    PRINTED,
    SUM,
    by_age,
    learners,
    most_frequent,
    recalled,
)
from experiments.corral.page import why_it_forgets
from experiments.corral.tables import failing
from experiments.corral.trajectories import (
    PLACES,
    as_rollout,
    control_steps,
    episodes_of,
    mistakes,
    representative_episode,
    with_recall,
)
from experiments.kit.figures import png

NAMES = {(1, 1): "forward", (-1, 1): "turn left", (1, -1): "turn right"}


@pytest.fixture(scope="module", autouse=True)
def single_thread() -> Iterator[None]:
    with one_thread():
        yield


def name_of(command: Any) -> str:
    return NAMES.get(tuple(np.sign(command).astype(int).tolist()), "other")


def episodes(*names: str) -> pd.DataFrame:
    return pd.concat([episodes_of(rollout(name), steps(name)).assign(controller=name) for name in names])


def steps(name: str) -> pd.DataFrame:
    return control_steps(rollout(name))


def bins_of(name: str) -> int:
    encoder: Any = program(name).space.encoder
    return encoder.bins


def test_commands_have_names() -> None:
    given = np.array([[1, 1], [-1, 1], [1, -1], [-1, -1], [0, 1], [0.6, 0.7], [0.2, -1]])
    names = [COMMANDS[kind] for kind in kinds(given)]
    assert names == ["forward", "turn left", "turn right", "other", "other", "forward", "other"]


@pytest.mark.parametrize("who", ["default", "bundled", "paper_best_bins"])
@pytest.mark.parametrize("plane", SLICES, ids=lambda plane: plane.title)
def test_a_map_is_the_recall_cell_by_cell(who: str, plane: Slice) -> None:
    bins, teacher = bins_of(who), sim.Teacher()
    shown = command_map(program(who), bins, plane, held_out())
    assert len(shown) == bins**2
    for cell in shown.to_dict(orient="records"):
        reading = np.empty(3)
        for sensor, place in ((plane.x, cell["column"]), (plane.y, cell["row"])):
            high = sim.SENSORS[sensor].high
            reading[sensor] = high if place == bins - 1 else high * (place + 0.5) / bins
        high = sim.SENSORS[plane.third].high
        place = min(int(plane.fixed / high * bins), bins - 1)
        reading[plane.third] = high if place == bins - 1 else high * (place + 0.5) / bins
        np.testing.assert_allclose([cell[sensor.name] for sensor in sim.SENSORS], reading)
        assert COMMANDS[cell["learned"]] == name_of(program(who)(reading[None]).commands[0].numpy())
        assert COMMANDS[cell["teacher"]] == name_of(teacher(reading[None])[0])


def test_a_map_counts_the_samples_of_its_slice() -> None:
    shown = command_map(program("default"), 8, Slice(RIGHT, DISTANCE, 5.0, "left light dark"), held_out())
    expected = np.zeros((8, 8), dtype=int)
    for left, right, distance in held_out().sensors.tolist():
        if left >= 5.0:
            expected[min(int(distance / 0.6 * 8), 7), min(int(right / 5 * 8), 7)] += 1
    np.testing.assert_array_equal(shown.samples.to_numpy().reshape(8, 8), expected)
    assert expected.sum() > 0
    lit = command_map(program("default"), 8, Slice(LEFT, RIGHT, 0.1, "wall near"), held_out())
    assert lit.samples.sum() == int((held_out().sensors[:, 2] < 0.22).sum())


@pytest.fixture(scope="module")
def panel() -> pd.DataFrame:
    return recalled(learners(settings(), 4), material().moving).assign(bins=4)


def test_recall_by_age_against_asking_one_by_one(panel: pd.DataFrame) -> None:
    rules, train = learners(settings(), 4), material().moving
    commands: dict[tuple[int, ...], set[str]] = {}
    readings: dict[tuple[int, ...], torch.Tensor] = {}
    space = rules[DEFAULT][0]
    for reading, command in zip(train.sensors, train.commands.numpy(), strict=True):
        condition = tuple(space.cells(reading[None])[0].tolist())
        commands.setdefault(condition, set()).add(name_of(command))
        readings.setdefault(condition, reading)
    order = list(commands)
    single = [condition for condition in order if len(commands[condition]) == 1]
    assert len(single) < len(order)
    assert set(panel.conditions) == {len(order)}
    assert panel.age.tolist() == [len(order) - 1 - order.index(condition) for condition in single]
    favourite = Counter(next(iter(commands[condition])) for condition in single).most_common(1)[0][1]
    assert most_frequent(panel) == pytest.approx(favourite / len(single))
    for learner, (space, rule) in rules.items():
        behaviour = rule.fit(space, train)
        right = [
            name_of(behaviour(readings[condition][None]).commands[0].numpy()) in commands[condition]
            for condition in single
        ]
        assert panel[learner].tolist() == right, learner


def test_groups_of_equal_age() -> None:
    groups = by_age(pd.DataFrame({"age": np.arange(20)[::-1], MEAN: np.arange(20) >= 10}), MEAN)
    assert groups.age.tolist() == [14.5, 4.5]
    assert groups.recall.tolist() == [0.0, 1.0]


def test_conditions_that_all_contradict_are_no_basis() -> None:
    shown = Demonstrations([[1.0, 1.0, 0.3]] * 2, [[1.0, 1.0], [-1.0, 1.0]])
    assert recalled(learners(settings(), 4), shown).empty


def test_the_words_follow_the_numbers() -> None:
    count = 40
    fading = pd.DataFrame({"bins": 8, "age": np.arange(count)[::-1], CLIPPED: np.arange(count) >= count * 3 / 4})
    words = why_it_forgets([fading, fading.assign(bins=4)])
    assert "recalls 100% of the newest fifth and 0% of the oldest at 8 bins, 100% of the newest fifth" in words
    assert why_it_forgets([fading.assign(**{CLIPPED: True})]) == ""


@pytest.mark.parametrize("who", ["default", "bundled"])
def test_a_timeline_is_the_recall_moment_by_moment(who: str) -> None:
    path = rollout(who).slice(2)
    line = with_recall(steps(who).loc[lambda frame: frame.episode == 2], program(who))
    assert line.seconds.iloc[-1] == pytest.approx((len(path) - 1) / 20)
    for at in range(0, len(path), 25):
        recall = program(who)(path.sensors[at][None])
        for column in ("similarity", "familiarity", "margin"):
            assert line[column].tolist()[at] == pytest.approx(float(getattr(recall, column)[0]), abs=1e-6)
        teacher = sim.Teacher()(path.sensors[at][None])[0]
        assert line.differs.tolist()[at] == (name_of(recall.commands[0].numpy()) != name_of(teacher))
        if recall.speaker is not None:
            assert line.speaker.tolist()[at] == list(sim.BEHAVIOURS)[int(recall.speaker[0])]
    assert ("speaker" in line) == (who == "bundled")


def test_a_rollout_comes_back_from_its_frames() -> None:
    one = rollout("paper")
    kept = steps("paper").loc[lambda frame: frame.episode.isin([0, 1, 5])]
    again = as_rollout(kept, episodes("paper"), settings())
    assert (again.arena, again.seed, again.seconds) == (one.arena, one.seed, one.seconds)
    assert again.summary().success_rate == one.success[[0, 1, 5]].mean()
    for episode in (0, 1, 5):
        for name in ("x", "heading", "sensors", "commands", "at_lamp"):
            np.testing.assert_array_equal(getattr(again.slice(episode), name), getattr(one.slice(episode), name))
    np.testing.assert_array_equal(again.start, one.start[[0, 1, 5]])


def test_the_representative_episode_succeeds_and_shows_everything() -> None:
    teacher = rollout("teacher")
    chosen = representative_episode(episodes("teacher"), ["teacher"])
    scores = {}
    for episode in STARTS:
        rules = set(sim.Teacher().rule(teacher.slice(episode).sensors).tolist())
        shown = sum(bool(rules & set(of)) for of in sim.BEHAVIOURS.values())
        scores[episode] = shown + 3 * bool(teacher.success[episode])
    best = [episode for episode in STARTS if scores[episode] == max(scores.values())]
    lengths = sorted((len(teacher.slice(episode)), episode) for episode in best)
    assert chosen == lengths[(len(lengths) - 1) // 2][1]
    assert representative_episode(episodes("teacher"), []) is None


@pytest.mark.parametrize("who", ["random", "paper"])
def test_failures_against_a_walk_through_the_episodes(who: str) -> None:
    one = rollout(who)
    failed = [episode for episode in STARTS if not one.success[episode]]
    assert failed
    found: Counter[tuple[str, str]] = Counter()
    places: Counter[str] = Counter()
    count = 0
    for episode in failed:
        path = one.slice(episode)
        count += len(path)
        for sensors, command in zip(path.sensors, path.commands, strict=True):
            rule = int(sim.Teacher().rule(sensors[None])[0])
            given = COMMANDS[int(kinds(command[None])[0])]
            if given != name_of(sim.Teacher()(sensors[None])[0]):
                found[sim.TEACHER_RULES[rule], given] += 1
        places[PLACES[2] if path.at_lamp[-1] else PLACES[int(one.escaped[episode])]] += 1
    (row,) = failing(episodes(who), [who])
    assert (row["failed"], row["of"]) == (len(failed), len(STARTS))
    assert {place: row[place] for place in PLACES} == {place: places[place] for place in PLACES}
    assert row["unlike_teacher"] == pytest.approx(sum(found.values()) / count)
    rows = mistakes(steps(who).loc[lambda frame: frame.episode.isin(failed)])
    assert {(row["rule"], row["command"]): round(row["share"] * count) for row in rows} == dict(found)
    assert [row["share"] for row in rows] == sorted((row["share"] for row in rows), reverse=True)


def test_a_controller_that_never_fails_has_no_mistakes() -> None:
    one = rollout("teacher")
    solved = one.success
    assert solved.any()
    driven = episodes("teacher")
    assert driven.end.isna().tolist() == solved.tolist()
    assert not driven.steps_unlike_teacher.any()
    assert mistakes(steps("teacher")) == []
    (row,) = failing(driven.loc[driven.success], ["teacher"])
    np.testing.assert_equal([row["failed"], row["unlike_teacher"]], [0, np.nan])


@pytest.mark.parametrize("who", ["default", "paper", "bundled"])
def test_differences_on_the_edge_of_a_threshold(who: str) -> None:
    behaviour, train = program(who), material().moving
    asked: dict[tuple[int, ...], set[str]] = {}
    for samples in (train, held_out()):
        for bins, command in zip(
            behaviour.space.cells(samples.sensors).tolist(), samples.commands.numpy(), strict=True
        ):
            asked.setdefault(tuple(bins), set()).add(name_of(command))
    edge = []
    answers = behaviour(held_out().sensors).commands.numpy()
    conditions = behaviour.space.cells(held_out().sensors).tolist()
    for bins, answer, command in zip(conditions, answers, held_out().commands.numpy(), strict=True):
        if name_of(answer) != name_of(command):
            edge.append(len(asked[tuple(bins)]) > 1)
    assert edge
    assert ambiguous_share(behaviour, train, held_out()) == pytest.approx(np.mean(edge))


def test_the_success_chart_says_what_it_draws() -> None:
    table = [{"controller": name, **asdict(rollout(name).summary())} for name in ("teacher", "paper", "random")]
    (axes,) = figures.success(table).axes
    assert [label.get_text() for label in axes.get_yticklabels()] == [row["controller"] for row in table]
    dots, bars = axes.lines[0], cast(Any, axes.collections[0])
    assert np.asarray(dots.get_xdata()).tolist() == [row["success_rate"] for row in table]
    ends = np.array([np.asarray(bar)[:, 0] for bar in bars.get_segments()])
    np.testing.assert_allclose(ends, [(row["success_low"], row["success_high"]) for row in table])
    # The first row of the table is drawn at the top.
    assert axes.get_ylim()[0] > axes.get_ylim()[1]


def test_the_recall_figure_draws_the_numbers(panel: pd.DataFrame) -> None:
    (axes,) = figures.recall_by_age([panel]).axes
    drawn = [np.stack([np.asarray(line.get_xdata()), np.asarray(line.get_ydata())]) for line in axes.lines]
    for learner in (PRINTED, CLIPPED, MEAN, SUM, DEFAULT):
        groups = by_age(panel, learner).sort_values(by="age")
        assert any(np.array_equal(line, groups[["age", "recall"]].to_numpy().T) for line in drawn), learner


def test_the_map_figure_draws_the_commands() -> None:
    maps = {plane: command_map(program("default"), 8, plane, held_out()) for plane in SLICES}
    figure = figures.command_maps({"default": pd.concat(maps.values())})
    images = [np.asarray(axes.collections[0].get_array()).ravel() for axes in figure.axes]
    for shown, teacher, learned in zip(maps.values(), images[:4], images[4:], strict=True):
        np.testing.assert_array_equal(teacher, shown.teacher)
        np.testing.assert_array_equal(learned, shown.learned)


def test_figures_are_drawn_alike_each_time() -> None:
    shown = {"teacher": rollout("teacher")}
    first, second = (png(figures.trajectories(shown, [0, 1])) for _ in range(2))
    assert first == second
    with Image.open(io.BytesIO(first)) as image:
        assert image.size[0] > 600
