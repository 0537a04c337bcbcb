"""What the figures show, against direct computations on a tiny run."""

import io
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest
import torch
from PIL import Image
from small_run import STARTS, one_thread, small_run

import sim
from behaviours import Demonstrations
from experiments import corral_text, figures
from experiments.command_map import COMMANDS, DISTANCE, LEFT, RIGHT, SLICES, Slice, command_map, kinds
from experiments.failures import PLACES, failures, on_the_edge
from experiments.forgetting import CLIPPED, DEFAULT, MEAN, PRINTED, SUM, Recalled, learners, recalled
from experiments.timeline import telling_episode, timeline

NAMES = {(1, 1): "forward", (-1, 1): "turn left", (1, -1): "turn right"}


@pytest.fixture(scope="module", autouse=True)
def single_thread() -> Iterator[None]:
    with one_thread():
        yield


def name_of(command: np.ndarray) -> str:
    return NAMES.get(tuple(np.sign(command).astype(int).tolist()), "other")


def test_commands_have_names() -> None:
    given = np.array([[1, 1], [-1, 1], [1, -1], [-1, -1], [0, 1], [0.6, 0.7], [0.2, -1]])
    names = [COMMANDS[kind] for kind in kinds(given)]
    assert names == ["forward", "turn left", "turn right", "other", "other", "forward", "other"]


@pytest.mark.parametrize("who", ["default", "bundled", "paper_best_bins"])
@pytest.mark.parametrize("plane", SLICES, ids=lambda plane: plane.title)
def test_a_map_is_the_recall_cell_by_cell(who: str, plane: Slice) -> None:
    run = small_run()
    mind = run.controllers[who].mind
    assert mind is not None
    shown = command_map(mind, plane, run.heldout)
    bins = mind.space.encoder.bins
    assert shown.learned.shape == (bins, bins)
    teacher = sim.Teacher()
    for row in range(bins):
        for column in range(bins):
            reading = np.empty(3)
            for sensor, place in ((plane.x, column), (plane.y, row)):
                high = sim.SENSORS[sensor].high
                reading[sensor] = high if place == bins - 1 else high * (place + 0.5) / bins
            high = sim.SENSORS[plane.third].high
            place = min(int(plane.fixed / high * bins), bins - 1)
            reading[plane.third] = high if place == bins - 1 else high * (place + 0.5) / bins
            np.testing.assert_allclose(shown.readings[row, column], reading)
            assert COMMANDS[shown.learned[row, column]] == name_of(mind(reading[None]).commands[0].numpy())
            assert COMMANDS[shown.teacher[row, column]] == name_of(teacher(reading[None])[0])
    np.testing.assert_array_equal(shown.differs, shown.learned != shown.teacher)


def test_a_map_counts_the_samples_of_its_slice() -> None:
    run = small_run()
    mind = run.controllers["default"].mind
    assert mind is not None
    shown = command_map(mind, Slice(RIGHT, DISTANCE, 5.0, "left light dark"), run.heldout)
    expected = np.zeros((8, 8), dtype=int)
    for left, right, distance in run.heldout.sensors.tolist():
        if left >= 5.0:
            expected[min(int(distance / 0.6 * 8), 7), min(int(right / 5 * 8), 7)] += 1
    np.testing.assert_array_equal(shown.met, expected)
    assert expected.sum() > 0
    lit = command_map(mind, Slice(LEFT, RIGHT, 0.1, "wall near"), run.heldout)
    assert lit.met.sum() == int((run.heldout.sensors[:, 2] < 0.22).sum())


@pytest.fixture(scope="module")
def panel() -> Recalled:
    run = small_run()
    return recalled(learners(run.results.config, 4), run.train)


def test_recall_by_age_against_asking_one_by_one(panel: Recalled) -> None:
    run = small_run()
    rules = learners(run.results.config, 4)
    commands: dict[tuple[int, ...], set[str]] = {}
    readings: dict[tuple[int, ...], torch.Tensor] = {}
    space = rules[DEFAULT][0]
    for reading, command in zip(run.train.sensors, run.train.commands.numpy(), strict=True):
        condition = tuple(space.cells(reading[None])[0].tolist())
        commands.setdefault(condition, set()).add(name_of(command))
        readings.setdefault(condition, reading)
    order = list(commands)
    single = [condition for condition in order if len(commands[condition]) == 1]
    assert len(single) < len(order)
    assert panel.conditions == len(order)
    assert panel.age.tolist() == [len(order) - 1 - order.index(condition) for condition in single]
    favourite = Counter(next(iter(commands[condition])) for condition in single).most_common(1)[0][1]
    assert panel.guess == pytest.approx(favourite / len(single))
    for learner, (space, rule) in rules.items():
        behaviour = rule.fit(space, run.train)
        right = [
            name_of(behaviour(readings[condition][None]).commands[0].numpy()) in commands[condition]
            for condition in single
        ]
        assert panel.right[learner].tolist() == right, learner
        assert panel.share(learner) == pytest.approx(np.mean(right))


def test_groups_of_equal_age() -> None:
    right = np.arange(20) >= 10
    panel = Recalled(4, 20, np.arange(20)[::-1], 0.5, {MEAN: right})
    age, recall = panel.by_age(MEAN)
    assert age.tolist() == [14.5, 4.5]
    assert recall.tolist() == [0.0, 1.0]


def test_conditions_that_all_contradict_are_no_basis() -> None:
    config = small_run().results.config
    shown = Demonstrations([[1.0, 1.0, 0.3]] * 2, [[1.0, 1.0], [-1.0, 1.0]])
    panel = recalled(learners(config, 4), shown)
    assert (panel.conditions, len(panel.age)) == (1, 0)


def test_the_words_follow_the_numbers() -> None:
    count = 40
    rights = {PRINTED: 0.5, CLIPPED: 0.25, MEAN: 0.25, SUM: 0.25, DEFAULT: 1.0}
    right = {name: np.arange(count) >= count * (1 - share) for name, share in rights.items()}
    panel = Recalled(8, count, np.arange(count)[::-1], 0.5, right)
    text, reason = corral_text.recall_summary(panel, {"clip_each_step": True})
    assert "as printed, the program recalls 50 %" in text
    assert "25 %: 100 % of the newest 8, 0 % of the oldest 8." in text
    assert "The largest gain comes from the default's rule and encoding (+75.0 points)." in text
    assert "clip" in reason
    assert len(corral_text.recall_summary(panel, {"clip_each_step": False})) == 1
    same = Recalled(8, count, panel.age, 0.5, dict.fromkeys(rights, np.ones(count, dtype=bool)))
    (text,) = corral_text.recall_summary(same, {"clip_each_step": True})
    assert text.endswith("None of these steps gains anything here.")


@pytest.mark.parametrize("who", ["default", "bundled"])
def test_a_timeline_is_the_recall_moment_by_moment(who: str) -> None:
    run = small_run()
    mind = run.controllers[who].mind
    assert mind is not None
    line = timeline(who, mind, run.rollouts[who], 2)
    path = run.rollouts[who].slice(2)
    assert line.seconds[-1] == pytest.approx((len(path) - 1) / 20)
    for at in range(0, len(path), 25):
        recall = mind(path.sensors[at][None])
        for column, value in ((line.similarity, recall.similarity), (line.familiarity, recall.familiarity)):
            assert column[at] == pytest.approx(float(value[0]), abs=1e-6)
        assert line.margin[at] == pytest.approx(float(recall.margin[0]), abs=1e-6)
        teacher = sim.Teacher()(path.sensors[at][None])[0]
        assert line.differs[at] == (name_of(recall.commands[0].numpy()) != name_of(teacher))
        if recall.speaker is not None and line.speaker is not None:
            assert line.speaker[at] == int(recall.speaker[0])
    assert (line.speaker is None) == (who == "default")


def test_the_telling_episode_succeeds_and_shows_everything() -> None:
    rollout = small_run().rollouts["teacher"]
    chosen = telling_episode([rollout])
    assert chosen is not None
    scores = {}
    for episode in STARTS:
        rules = set(sim.Teacher().rule(rollout.slice(episode).sensors).tolist())
        shown = sum(bool(rules & set(of)) for of in sim.BEHAVIOURS.values())
        scores[episode] = shown + 3 * bool(rollout.success[episode])
    best = [episode for episode in STARTS if scores[episode] == max(scores.values())]
    lengths = sorted((len(rollout.slice(episode)), episode) for episode in best)
    assert chosen == lengths[(len(lengths) - 1) // 2][1]
    assert telling_episode([]) is None


@pytest.mark.parametrize("who", ["random", "paper"])
def test_failures_against_a_walk_through_the_episodes(who: str) -> None:
    rollout = small_run().rollouts[who]
    found = failures(rollout)
    failed = [episode for episode in STARTS if not rollout.success[episode]]
    assert found.episodes.tolist() == failed
    assert failed
    mistakes: Counter[tuple[str, str]] = Counter()
    places: Counter[str] = Counter()
    steps = 0
    for episode in failed:
        path = rollout.slice(episode)
        steps += len(path)
        for sensors, command in zip(path.sensors, path.commands, strict=True):
            rule = int(sim.Teacher().rule(sensors[None])[0])
            given = COMMANDS[int(kinds(command[None])[0])]
            if given != name_of(sim.Teacher()(sensors[None])[0]):
                mistakes[sim.TEACHER_RULES[rule], given] += 1
        inside = max(abs(path.x[-1]), abs(path.y[-1])) < rollout.arena.side / 2
        places[PLACES[2] if path.at_lamp[-1] else PLACES[0] if inside else PLACES[1]] += 1
    assert found.ends == {place: places[place] for place in PLACES}
    assert found.wrong == pytest.approx(sum(mistakes.values()) / steps)
    assert {(m.rule, m.command): round(m.share * steps) for m in found.mistakes} == mistakes
    shares = [mistake.share for mistake in found.mistakes]
    assert shares == sorted(shares, reverse=True)


def test_no_failures_of_a_perfect_rollout() -> None:
    rollout = small_run().rollouts["teacher"]
    perfect = sim.Rollout(**{**vars(rollout), "success": np.ones(len(rollout), dtype=bool)})
    found = failures(perfect)
    assert (len(found.episodes), found.wrong, found.mistakes, sum(found.ends.values())) == (0, 0.0, [], 0)


@pytest.mark.parametrize("who", ["default", "paper", "bundled"])
def test_differences_on_the_edge_of_a_threshold(who: str) -> None:
    run = small_run()
    mind = run.controllers[who].mind
    assert mind is not None
    asked: dict[tuple[int, ...], set[str]] = {}
    for part in (run.train, run.heldout):
        for bins, command in zip(mind.space.cells(part.sensors).tolist(), part.commands.numpy(), strict=True):
            asked.setdefault(tuple(bins), set()).add(name_of(command))
    edge = []
    answers = mind(run.heldout.sensors).commands.numpy()
    conditions = mind.space.cells(run.heldout.sensors).tolist()
    for bins, answer, command in zip(conditions, answers, run.heldout.commands.numpy(), strict=True):
        if name_of(answer) != name_of(command):
            edge.append(len(asked[tuple(bins)]) > 1)
    assert edge
    assert on_the_edge(mind, run.train, run.heldout) == pytest.approx(np.mean(edge))


def test_the_success_chart_says_what_it_draws() -> None:
    table = small_run().results.table
    figure = figures.success(table)
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == [row["controller"] for row in table]
    dots = [line.get_xdata() for line in axes.lines if line.get_marker() == "o"]
    assert np.concatenate([np.atleast_1d(np.asarray(dot)) for dot in dots]).tolist() == [
        row["success_rate"] for row in table
    ]
    first = table[0]
    assert f"[{first['success_low']:.3f}, {first['success_high']:.3f}]" in axes.texts[0].get_text()
    # The first row of the table is drawn at the top.
    assert axes.get_ylim()[0] > axes.get_ylim()[1]


def test_the_recall_figure_draws_the_numbers(panel: Recalled) -> None:
    (axes,) = figures.forgetting([panel]).axes
    drawn = {str(line.get_label()): line for line in axes.lines}
    for learner in panel.right:
        age, recall = panel.by_age(learner)
        np.testing.assert_array_equal(drawn[learner].get_xdata(), age)
        np.testing.assert_array_equal(drawn[learner].get_ydata(), recall)


def test_the_map_figure_draws_the_commands() -> None:
    run = small_run()
    mind = run.controllers["default"].mind
    assert mind is not None
    maps = [command_map(mind, plane, run.heldout) for plane in SLICES]
    figure = figures.command_maps({"default": maps})
    images = [axes.images[0].get_array() for axes in figure.axes]
    for shown, (teacher, learned) in zip(maps, zip(images[: len(maps)], images[len(maps) :], strict=True), strict=True):
        np.testing.assert_array_equal(np.asarray(teacher), shown.teacher)
        np.testing.assert_array_equal(np.asarray(learned), shown.learned)


def test_figures_are_drawn_alike_each_time() -> None:
    run = small_run()
    shown = {"teacher": run.rollouts["teacher"]}
    first, second = (figures.png(figures.trajectories(shown, [0, 1])) for _ in range(2))
    assert first == second
    with Image.open(io.BytesIO(first)) as image:
        assert image.size[0] > 600
