"""The study of partly observable states: its figures by hand, and the command as a user would run it."""

import io
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import torch
from commands import only, results, shared_output_of
from kits import composed
from rich.console import Console

import sim
from behaviours import Demonstrations
from experiments.kit import Outcome
from experiments.kit.run import check_all, run
from experiments.main import main
from experiments.models.disturbances import DISTURBANCES, HIGH, LOW, Disturbance
from experiments.observability.learners import Learned, Task, best, compare
from experiments.observability.memory import Memory, TeacherRuns
from experiments.observability.results import FIGURE, means, tables
from experiments.observability.study import Observability, cells, study
from experiments.observability.windows import ProgramAnswer, WindowPolicy

SMALL = (
    "demonstrations=8", "validation=4", "heldout=4", "starts=4", "seconds=4", "vsa.dim=300", "encoder.bins=8",
    "encoder.span=2", "epochs=2", "lags=[[1],[1,2]]", "leaves=[5]", "strengths.missing=[0,0.5]",
    "strengths.aliased=[0,1]", "disturbances=[missing,aliased]", "learners=[teacher,default,trace,hold,tree_memory]",
    "bullet_learners=[]",
)  # fmt: skip


def settings(*overrides: str) -> Observability:
    return cast(Observability, composed(study, *overrides))


def test_an_undisturbed_teacher_drives_as_the_teacher() -> None:
    def drive(policy: sim.ControllerLike) -> sim.Rollout:
        return sim.rollout(policy, episodes=range(3), seconds=5, robots=2)

    undisturbed: Disturbance = DISTURBANCES["delayed"](0, 0)

    def of_the_present(seen: Any) -> Any:
        assert seen.shape[1] == 9  # now, and 1 and 4 steps ago
        return sim.Teacher()(seen[:, :3])

    own = drive(sim.Teacher())
    for answer, memory in ((sim.Teacher(), Memory()), (of_the_present, Memory((1, 4)))):
        through = drive(WindowPolicy(undisturbed, answer, memory))
        np.testing.assert_array_equal(own.trajectory.sensors, through.trajectory.sensors)


def runs(commands: list[list[float]], moving: list[bool] | None = None) -> TeacherRuns:
    """One episode with these commands of the teacher, at readings in the middle of their ranges."""
    size = len(commands)
    readings = np.tile((LOW + HIGH) / 2, (size, 1))
    moving = [True] * size if moving is None else moving
    return TeacherRuns(readings, np.array(commands), np.zeros(size, np.int64), np.arange(size), np.array(moving))


STRAIGHT, LEFT, RIGHT = [1.0, 1.0], [-1.0, 1.0], [1.0, -1.0]


def test_agreement_counts_moments_and_balanced_agreement_counts_commands() -> None:
    # Before the lamp: six times straight, once left, once right. Who always drives straight is right six times of
    # eight, and for one command of three.
    shown = runs([*[STRAIGHT] * 6, LEFT, RIGHT, LEFT], [True] * 8 + [False])
    learned = Learned(lambda seen: np.tile(STRAIGHT, (len(seen), 1)))
    found = compare(learned, DISTURBANCES["missing"](0, 0), shown, every=1)
    assert (found.samples, found.agreement, found.usual_share) == (8, 0.75, 0.75)
    assert found.balanced_agreement == pytest.approx(1 / 3)
    assert compare(learned, DISTURBANCES["missing"](0, 0), shown, every=3).samples == 3


def test_the_choice_is_the_best_on_validation_runs_and_is_told() -> None:
    def always(command: list[float]) -> Learned:
        return Learned(lambda seen: np.tile(command, (len(seen), 1)))

    undisturbed = [DISTURBANCES["missing"](0, 0)]
    task = Task(settings("compare_every=1"), None, runs([RIGHT]), runs([LEFT, LEFT]), undisturbed)  # pyright: ignore[reportArgumentType]
    chosen = best(task, {"right": lambda: always(RIGHT), "left": lambda: always(LEFT)})
    assert chosen.tried == {"right": 0.0, "left": 1.0}
    np.testing.assert_array_equal(chosen.answer(np.zeros((1, 3))), [LEFT])


def test_a_robot_that_senses_nothing_does_what_was_demonstrated_most_often() -> None:
    shown = Demonstrations(np.zeros((3, 3)), [LEFT, STRAIGHT, LEFT])

    class Blind:
        def __call__(self, seen: torch.Tensor) -> Any:
            commands = torch.full((len(seen), 2), torch.nan, dtype=torch.float64)
            commands[0] = 1.0
            return type("Recall", (), {"commands": commands})

    answer = ProgramAnswer(Blind(), shown)  # pyright: ignore[reportArgumentType]
    np.testing.assert_array_equal(answer(np.full((2, 3), np.nan)), [STRAIGHT, LEFT])


def test_demonstrations_leave_out_moments_without_any_reading() -> None:
    shown = runs([STRAIGHT] * 400)
    lost = DISTURBANCES["missing"](0.7, 0)
    seen = sim.replay(lost, shown.readings, shown.episodes)
    found = shown.demonstrations([lost], Memory((1,)))
    blind = np.isnan(seen).sum(1) == seen.shape[1]
    # With a memory of one step, what is lost now and before is lost.
    never = np.logical_and(blind, np.append(True, blind[:-1]))
    assert never.any()
    assert len(found) == 400 - np.count_nonzero(never)
    with pytest.raises(ValueError, match="choose weaker disturbances"):
        shown.demonstrations([DISTURBANCES["missing"](1, 0)], Memory())


def row(learner: str, strength: float, agreement: float, success: float | None) -> dict[str, Any]:
    return {
        "learner": learner, "disturbance": "missing", "strength": strength,
        "balanced_agreement": agreement, "success_rate": success,
    }  # fmt: skip


def test_means_are_over_the_strengths_above_0() -> None:
    table = [
        row("default", 0.0, 1.0, 1.0), row("default", 0.5, 0.5, None), row("default", 0.8, 0.3, 0.1),
        row("trace", 0.8, 0.5, 0.6), row("tree", 0.5, 0.7, None),
    ]  # fmt: skip
    found = means(table, "balanced_agreement")
    assert found.learner.tolist() == ["default", "trace", "tree"]
    assert found.balanced_agreement.tolist() == pytest.approx([0.4, 0.5, 0.7])
    assert means(table, "success_rate").learner.tolist() == ["default", "trace"]


def outcome(success: float | None) -> Outcome:
    """What a run of two learners at one strength found."""
    measured = {
        "label": "0.5",
        "agreement": 0.9,
        "usual_share": 0.8,
        "success_low": success,
        "success_high": success,
    }
    table = [row(name, 0.5, 0.7, success) | measured for name in ("default", "tree")]
    return Outcome(Path(), settings("learners=[default,tree]"), {}, pd.DataFrame(), table, {}, {})


def test_the_figure_shows_success_only_if_somebody_drove() -> None:
    def titles(success: float | None) -> list[str]:
        return [axes.get_ylabel() for axes in FIGURE.draw(outcome(success)).axes]

    assert titles(None) == ["balanced agreement", "agreement"]
    assert titles(0.5) == ["balanced agreement", "agreement", "success rate"]


def test_a_table_of_each_disturbance_has_all_measures() -> None:
    missing, learners = tables(outcome(0.25))
    assert [[cell.text for cell in line] for line in missing.cells] == [
        ["default", "0.900 / 0.70 / 0.25"],
        ["tree", "0.900 / 0.70 / 0.25"],
    ]
    assert [column.title for column in missing.columns] == ["learner", "0.5"]
    assert [line[0].text for line in learners.cells] == ["default", "tree"]


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("learners=[nobody]", "learners: there is no 'nobody'; choose from teacher, "),
        ("disturbances=[fog]", "disturbances: there is no 'fog'"),
        ("disturbances=[missing,missing]", "disturbances names 'missing' 2 times"),
        ("learners=[]", "learners is empty; choose from teacher, "),
        ("strengths.missing=[0.5]", "strengths.missing grow from 0"),
        ("strengths.missing=[0,2]", r"strengths.missing=\[0,2\]: expected a number from 0 to 1"),
        ("strengths.noisy=[]", "strengths.noisy is empty"),
        ("strengths.aliased=[0,9]", "strengths.aliased: there is no 9; choose from 0, 1, 2, 3, 4"),
        ("starts=-1", "starts=-1: expected a number from 0 to 1000000"),
        ("heldout=0", "heldout=0: expected a number from 1 to 1000000"),
        ("lags=[]", "lags is empty"),
        ("lags=[[2,1]]", "increasing whole numbers of steps"),
        ("leaves=[0]", "leaves="),
        ("rule.name=guess", "no learning rule 'guess'"),
    ],
)
def test_what_is_not_there_is_named(override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, settings(override))


def test_a_rule_that_cannot_train_the_architecture_is_refused() -> None:
    with pytest.raises(ValueError, match="the rule least_squares cannot train programs of HRR"):
        check_all(study, settings("vsa=hrr", "rule=least_squares"))


def test_a_delay_of_part_of_a_step_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")  # which the command changes
    with pytest.raises(SystemExit) as exit_:
        main(["observability", "strengths.delayed=[0,0.5]"])
    assert exit_.value.code == 1
    error = capsys.readouterr().err
    assert error.startswith("observability: strengths.delayed")
    assert error.endswith("=0.5: expected a whole number\n")
    assert error.count("\n") == 1
    assert not list(tmp_path.rglob("results.json"))


def test_the_slowest_cells_come_first_and_memories_of_gaps_only_where_there_are_gaps() -> None:
    found = cells(settings("disturbances=[missing,noisy]", "learners=[teacher,trace,held_trace,tree]"))
    names = [(cell["disturbance"], cell["learner"]) for cell in found]
    assert set(names[:3]) == {("missing", "trace"), ("missing", "held_trace"), ("noisy", "trace")}
    assert len(names) == 7


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny run."""
    folder = tmp_path_factory.mktemp("observability")
    assert "balanced" in shared_output_of(folder, "observability", *SMALL, "workers=1")
    return folder


def test_the_command_writes_what_it_promises(finished: Path) -> None:
    content = results(finished)
    everywhere = ["teacher", "default", "trace", "tree_memory"]
    assert [(r["disturbance"], r["learner"], r["strength"]) for r in content["table"]] == [
        (disturbance, learner, strength)
        for disturbance, learners, strengths in (
            ("missing", [*everywhere[:3], "hold", "tree_memory"], (0, 0.5)),
            ("aliased", everywhere, (0, 1)),
        )
        for learner in learners
        for strength in strengths
    ]
    rows = {(r["disturbance"], r["strength"], r["learner"]): r for r in content["table"]}
    assert rows["missing", 0, "teacher"]["agreement"] == rows["aliased", 0, "teacher"]["agreement"] == 1.0
    assert rows["missing", 0.5, "teacher"]["agreement"] < 1.0
    assert rows["missing", 0, "default"]["agreement"] > 0.9
    assert (rows["missing", 0.5, "hold"]["lags"], rows["missing", 0.5, "hold"]["hold"]) == ([], True)
    for key, figures in rows.items():
        place = f"{key[0]}.{key[1]:g}.{key[2]}"
        assert content["metrics"][f"{place}.success_rate"] == figures["success_rate"]
        low, high = sim.wilson(round(figures["success_rate"] * 4), 4)
        assert (figures["success_low"], figures["success_high"]) == pytest.approx((low, high))
    records = pq.read_table(only(finished, "records.parquet")).to_pylist()
    assert len([record for record in records if record["choice"] is None]) == len(rows) * 4
    for (disturbance, strength, learner), figures in rows.items():
        own = [
            record
            for record in records
            if (record["disturbance"], record["strength"], record["learner"]) == (disturbance, strength, learner)
        ]
        assert [record["episode"] for record in own] == [0, 1, 2, 3]
        assert figures["success_rate"] * 4 == sum(record["success"] for record in own)
        assert figures["escape_rate"] * 4 == sum(record["escaped"] for record in own)
    assert only(finished, "observability.png").stat().st_size > 10_000


def test_the_memory_with_the_highest_validation_figure_is_the_one_of_the_rows(finished: Path) -> None:
    content = results(finished)
    key = "aliased.trace.validation."
    tried = {name.removeprefix(key): value for name, value in content["metrics"].items() if name.startswith(key)}
    assert list(tried) == ["1 step ago", "1, 2 steps ago"]
    (chosen,) = {tuple(r["lags"]) for r in content["table"] if (r["disturbance"], r["learner"]) == ("aliased", "trace")}
    assert str(Memory(chosen)) == max(tried, key=lambda name: tried[name])
    page = only(finished, "report.html").read_text()
    assert "data:image/png;base64," in page
    assert "1, 2 steps ago" in page


def test_the_same_seed_gives_the_same_results_in_other_batches(finished: Path, tmp_path: Path) -> None:
    names = ("teacher", "trace", "hold")
    part = ("workers=1", "robots=3", "disturbances=[missing]", f"learners=[{','.join(names)}]")
    again = run(study, settings(*SMALL, *part), tmp_path, Console(file=io.StringIO()))
    before = results(finished)
    rows = [row for row in before["table"] if row["disturbance"] == "missing" and row["learner"] in names]
    assert len(rows) == 6
    assert again.table == rows
    assert len(again.metrics) > 20
    assert again.metrics.items() <= before["metrics"].items()


def test_without_starts_agreement_is_all_that_is_measured(tmp_path: Path) -> None:
    chosen = ("starts=0", "disturbances=[missing]", "learners=[teacher,tree]", "workers=1")
    found = run(study, settings(*SMALL, *chosen), tmp_path, Console(file=io.StringIO()))
    assert [(row["learner"], row["episodes"], row["success_rate"]) for row in found.table] == [
        (learner, 0, None) for learner in ("teacher", "teacher", "tree", "tree")
    ]
    assert "could not be drawn" not in (tmp_path / "report.html").read_text()
