"""The study that compares the engines."""

from pathlib import Path

import numpy as np
import pytest
from kits import composed
from rich.console import Console

import sim
from experiments.engines import agree, before_touch, study
from experiments.kit.run import check_all, run


def test_both_engines_drive_from_the_same_starts(tmp_path: Path) -> None:
    settings = composed(study, "arenas=[default,two_lamps]", "controllers=[teacher,default]", "starts=4", "seconds=10",
                        "demonstrations=3", "vsa.dim=256", "workers=1")  # fmt: skip
    outcome = run(study, settings, tmp_path, Console(quiet=True))
    driven = set(zip(outcome.records.arena, outcome.records.controller, outcome.records.engine, strict=True))
    assert len(driven) == 2 * 3  # two lights are nothing for what learned with one
    assert {(row["arena"], row["controller"]) for row in outcome.table} == {key[:2] for key in driven}
    assert max(row["apart_m"] for row in outcome.table) < 1e-9
    (row,) = (row for row in outcome.table if row["measure"] == "success" and row["arena"] == "two_lamps")
    own = outcome.records[(outcome.records.arena == "two_lamps") & (outcome.records.engine == "bullet")]
    assert row["bullet"] == own.success.mean()
    assert (tmp_path / "figures" / "arenas.png").is_file()
    assert (tmp_path / "figures" / "engines.png").is_file()


@pytest.mark.parametrize(("vector", "expected"), [(0.5, True), (0.58, True), (0.7, False), (0.35, False)])
def test_engines_agree_if_each_mean_is_in_the_others_interval(vector: float, expected: bool) -> None:
    row = {"vector": vector, "vector_low": vector - 0.1, "vector_high": vector + 0.1}
    assert agree({**row, "bullet": 0.5, "bullet_low": 0.4, "bullet_high": 0.6}) == expected


def test_paths_count_until_either_robot_touches_something() -> None:
    runs = [sim.rollout(sim.Teacher(), episodes=[3], seed=seed, seconds=5.0).slice(3) for seed in (1, 2)]
    arena = sim.corral()
    apart = np.hypot(runs[0].x - runs[1].x, runs[0].y - runs[1].y)
    touched = [int(np.argmax(arena.touched(path.x, path.y))) or len(path) for path in runs]
    assert before_touch(arena, *runs) == pytest.approx(apart[: min(touched)].max())
    assert before_touch(arena, runs[0], runs[0]) == 0.0


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["engine=bullet"], "engine=bullet: this study drives in both engines"),
        (["body=wheeled"], "body=wheeled: engine=vector does not have it"),
        (["vsa=hrr", "rule=least_squares"], "the rule least_squares cannot train programs of HRR"),
        (["composition.weights={nobody:1}"], "composition.weights={nobody}: .*nobody"),
    ],
)
def test_what_cannot_work_is_refused_before_anything_is_driven(overrides: list[str], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, composed(study, *overrides))
