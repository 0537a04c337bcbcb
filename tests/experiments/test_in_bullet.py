"""What drove in the fast engine drives again in the physics engine: which starts, and what is said of them."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from commands import only, output_of, results
from kits import composed
from rich.console import Console

import sim
from experiments.architectures import study as architectures
from experiments.composition.damage import study as damage
from experiments.generalisation.corral import study as generalisation
from experiments.generalisation.smooth import study as smooth
from experiments.kit.run import check_all, run
from experiments.observability.study import study as observability
from experiments.robustness.study import study as robustness
from experiments.tasks import corral, in_bullet

DRIVING = ("seconds=12", "bullet_starts=4", "wheeled_starts=2")
SMALL = {
    "robustness": (
        "vsa.dim=300", "encoder.bins=8", "encoder.span=2", "demonstrations=4", "starts=6", "draws=2", "shares=[0,0.4]",
        "drive_shares=[0,0.4]", "damages=[flip]", "parts=[program]", "learners=[default,decision_tree]",
    ),
    "observability": (
        "vsa.dim=300", "encoder.bins=8", "encoder.span=2", "demonstrations=4", "validation=2", "heldout=2", "starts=6",
        "strengths.missing=[0,0.5]", "disturbances=[missing]", "learners=[teacher,default]",
    ),
    "generalisation": (
        "vsa.dim=300", "encoders=[level]", "protections=[none]", "records=[product]", "rules=[error_driven,one_shot]",
        "demonstrations=[1,3]", "draws=[1,1]", "starts=6", "variant_starts=2", "arenas=[default,narrow]",
        "baselines=[]",
    ),
    "architectures": (
        "architectures=[MAP-C,VTB]", "dim=400", "encoders=[level]", "records=[product,sum]", "bins=8",
        "demonstrations=4", "starts=6", "repeats=1",
    ),
    "damage": (
        "vsa.dim=512", "demonstrations=6", "heldout=4", "codebooks=2", "starts=6",
        "rows=[joint_program,plain_sum]", "bullet_rows=[joint_program]", "flips=[0.1,0.4]", "noise=[]",
        "bullet_flips=[0,0.4]",
    ),
    "smooth": ("models=[one_hypervector]", "dims=[50,200]", "blocks=1", "demonstrations=2", "starts=6"),
}  # fmt: skip
EXPECTED = {
    "robustness": {"learner": {"default"}},
    "observability": {"learner": {"default"}},
    "generalisation": {"learner": {"level/none/product/error_driven"}},
    "architectures": {"architecture": {"MAP-C", "VTB"}, "encoder": {"product of level"}},
    "damage": {"row": {"joint_program"}, "level": {0.0, 0.4}},
    "smooth": {"task": {"corral"}, "model": {"teacher", "one_hypervector"}},
}
"""What two rows of each study that drive again have in their columns."""
STUDIES = {study.name: study for study in (architectures, damage, generalisation, observability, robustness, smooth)}


def settings(name: str, *overrides: str) -> Any:
    return composed(STUDIES[name], *SMALL[name], *DRIVING, *overrides)


def test_effects_are_differences_from_the_same_starts() -> None:
    # Within these seconds some starts succeed, and friction and weight decide of others.
    given = settings("robustness", "seconds=9", "bullet_starts=12", "wheeled_starts=8")
    rollout = corral.drive(given, sim.Teacher(), range(1, 20, 2), "default")
    found = in_bullet.effects(given, sim.Teacher(), rollout)
    for body, count in (("planar", 12), ("wheeled", 8)):
        first = [episode for episode in range(1, 20, 2) if episode < count]
        engines = [
            sim.rollout(sim.Teacher(), "default", own, first, seconds=9, engine=engine, record=False).success
            for engine, own in (("bullet", body), ("vector", "planar"))
        ]
        assert found[body] == (engines[0].astype(int) - engines[1]).tolist()
    assert any(found["planar"] + found["wheeled"])
    assert in_bullet.counted({"planar": [0, 1, -1, 0]}) == {"planar_same": 2, "planar_gained": 1, "planar_lost": 1}


def test_differences_count_all_records() -> None:
    counts = [{"wheeled_same": 5, "wheeled_gained": 0, "wheeled_lost": 3}, {"draw": 1}]
    counts += [{"wheeled_same": 1, "wheeled_gained": 1, "wheeled_lost": 0}]
    row = in_bullet.differences(pd.DataFrame(counts))
    assert (row["wheeled_starts"], row["planar_starts"], row["planar_minus_vector"]) == (10, None, None)
    assert row["wheeled_minus_vector"] == pytest.approx(-0.2)
    assert -0.6 <= row["wheeled_minus_vector_low"] < -0.2 < row["wheeled_minus_vector_high"] <= 0.2
    assert in_bullet.tables([], [{"planar_starts": None}], "") == []


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_drives_a_subset_in_the_physics_engine(name: str, tmp_path: Path) -> None:
    printed = output_of(tmp_path, name, *SMALL[name], *DRIVING, "workers=1")
    assert "The same in the physics engine" in printed
    driven = [row for row in results(tmp_path)["table"] if row.get("planar_starts")]
    assert [row["planar_starts"] for row in driven] == [4, 4]
    assert [row["wheeled_starts"] for row in driven] == [2, 2]
    for column, values in EXPECTED[name].items():
        assert {row[column] for row in driven} == values
    records = pq.read_table(only(tmp_path, "records.parquet")).to_pandas()
    rates = records.filter(regex="^(planar|wheeled)_").sum()
    assert rates.filter(like="planar").sum() == 8
    assert rates.filter(like="wheeled").sum() == 4
    mean = np.mean([row["wheeled_minus_vector"] for row in driven])
    assert mean == pytest.approx((rates["wheeled_gained"] - rates["wheeled_lost"]) / 4)


def test_in_the_physics_engine_nothing_drives_twice(tmp_path: Path) -> None:
    chosen = (
        "learners=[decision_tree]",
        "bullet_learners=[decision_tree]",
        "shares=[0]",
        "drive_shares=[0]",
        "starts=2",
    )
    given = settings("robustness", "engine=bullet", *chosen, "seconds=3", "workers=1")
    assert in_bullet.counts(given) == {}
    table = run(STUDIES["robustness"], given, tmp_path, Console(file=io.StringIO())).table
    assert not any(row.get("planar_starts") for row in table)


def test_another_mistake_is_told_as_it_is() -> None:
    with pytest.raises(ValueError, match=r"choose engine=bullet$"):
        check_all(STUDIES["robustness"], settings("robustness", "body=wheeled"))


def test_without_pybullet_it_is_said_how_to_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(corral, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pybullet.*or leave it out: bullet_starts=0 wheeled_starts=0$"):
        check_all(STUDIES["observability"], settings("observability"))
    for overrides in (["bullet_learners=[]"], ["bullet_starts=0", "wheeled_starts=0"], ["starts=0"]):
        check_all(STUDIES["observability"], settings("observability", *overrides))
