"""The study of combination, small."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from kits import composed
from rich.console import Console

import sim
from behaviours import BehaviourBank, Demonstrations, OneShot, Priority
from experiments.composition import damage, study
from experiments.composition.measure import distinct
from experiments.composition.rows import MASKED, ROWS, Shown, line_of
from experiments.kit.run import check_all, run
from experiments.models.behaviour_tree import BehaviourTree
from experiments.tasks import corral, in_bullet
from experiments.tasks.asked_once import EachAskedOnce
from experiments.tasks.behaviours import BEHAVIOURS, Precedence
from experiments.tasks.in_bullet import TWINS
from torchvsa.registry import Registry

SMALL = ("vsa.dim=512", "demonstrations=6", "heldout=3", "codebooks=2", "seconds=12")


def shown() -> Shown:
    driven = sim.rollout(sim.Teacher(), episodes=range(1_000_000, 1_000_006), seconds=25, record=True)
    return Shown(composed(study, *SMALL), corral.moving(driven))


def test_rows_drive_in_each_arena_with_several_codebooks(tmp_path: Path) -> None:
    settings = composed(
        study, *SMALL, "rows=[teacher,joint_program,evident_sum,masked_sum,plain_sum,gated]", "bullet_rows=[teacher]",
        "arenas=[default,large]", "starts=6", "bullet_starts=4", "wheeled_starts=2", "workers=1",
    )  # fmt: skip
    outcome = run(study, settings, tmp_path, Console(quiet=True))
    assert len(outcome.table) == 8 * 2
    rows = {(row["row"], row["arena"]): row for row in outcome.table}
    assert rows["teacher", "default"]["agreement"] == 1.0
    for twin, count in (("bullet", 4), ("wheeled", 2)):
        row, first = rows[f"teacher_{twin}", "large"], range(count)
        driven = [
            sim.rollout(sim.Teacher(), "large", body, first, seconds=settings.seconds, engine=engine).success.mean()
            for engine, body in (("bullet", TWINS[twin]), ("vector", "planar"))
        ]
        assert (row["starts"], row["success_rate"]) == (count, driven[0])
        assert row["minus_vector"] == pytest.approx(driven[0] - driven[1])
    found = outcome.records.loc[(outcome.records.row == "evident_sum") & (outcome.records.arena == "default")]
    assert found.episodes.tolist() == [3, 3]
    assert outcome.metrics["evident_sum.default.agreement"] == pytest.approx(found.agreement.mean())
    assert outcome.metrics["evident_sum.default.success_rate"] == found.successes.sum() / 6
    assert outcome.metrics["joint_program.large.agreement_avoid"] is not None
    assert rows["evident_sum", "default"]["agreement"] > 0.9
    assert rows["evident_sum", "default"]["ceiling"] >= rows["joint_program", "default"]["agreement"]
    for name in ("success", "agreement", "paths", "familiarity"):
        assert (tmp_path / "figures" / f"{name}.png").is_file()
    path = pd.read_parquet(tmp_path / "paths" / "gated.parquet")
    assert set(path.speaker) <= {"seek_light", "avoid", "cruise"}
    assert "within" in study.headline(outcome)


def test_what_cannot_work_is_refused() -> None:
    for overrides, message in (
        (("rule@evident=one_shot",), "cannot keep silence"),
        (("arenas=[two_lamps]",), "more than one light"),
        (("rows=[teacher]", "bullet_rows=[vote]"), "vote is not among the rows"),
        (("engine=bullet",), "engine=bullet: name the rows for the physics engine"),
        (
            ("rows=[paper_sum]", "vsa=hrr", "rule@evident=error_driven", "rule@paper.rule=least_squares"),
            "rows: paper_sum: .* cannot train programs of HRR",
        ),
        (("rows=[plain_subset_record]", "vsa=hrr", "rule@evident=error_driven"), "rows: plain_subset_record: record"),
        (("rows=[oracle]", "record=random_fourier"), "rows: oracle: it asks each condition once"),
        (("body=wheeled",), "body=wheeled: engine=vector does not have it"),
    ):
        with pytest.raises(ValueError, match=message):
            check_all(study, composed(study, *overrides))


def test_every_row_can_be_made() -> None:
    what = shown()
    readings = what.train.sensors[:20].numpy()
    for name, line in ROWS.items():
        made = line.make(what, 0)
        commands = np.asarray(sim.replay(made, readings, np.arange(20)))
        assert commands.shape == (20, 2), name
        assert np.isfinite(commands).all(), name


def test_the_ceiling_is_what_the_best_function_of_the_bins_reaches() -> None:
    what = shown()
    moments = distinct(what, what.train)
    assert moments.count.sum() == len(what.train)
    cells = what.space(0).cells(what.train.sensors).numpy()
    commands = what.train.commands.numpy()
    best = 0
    for cell in np.unique(cells, axis=0):
        here = commands[(cells == cell).all(1)]
        best += np.unique(here, axis=0, return_counts=True)[1].max()
    assert moments.ceiling == pytest.approx(best / len(what.train))


def test_each_start_drives_with_its_own_codebook() -> None:
    what = shown()
    banks = [what.bank(codebook) for codebook in range(2)]
    each = EachAskedOnce([bank["seek_light"] for bank in banks])
    readings = what.train.sensors[:10].numpy()
    which = each.start(np.arange(10))
    assert which.tolist() == [0, 1] * 5
    commands = each.step(readings, which)[0].commands
    for codebook, bank in enumerate(banks):
        own = bank["seek_light"](readings[codebook::2]).commands
        assert torch.equal(commands[codebook::2], own)


def test_behaviours_and_policies_of_ones_own_are_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def retreat(readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return readings[:, 2] < 0.06, np.tile([-1.0, -0.5], (len(readings), 1))

    # For this test only: other tests compare all names with the docs.
    known = Registry("behaviour", {**BEHAVIOURS, "retreat": retreat})
    for module in ("experiments.tasks.behaviours", "experiments.composition.settings"):
        monkeypatch.setattr(f"{module}.BEHAVIOURS", known)
    settings = composed(
        study, *SMALL, "behaviours=[retreat,seek_light,avoid,cruise]", "rows=[teacher,sequencing]",
        "bullet_rows=[]", "arenas=[large]", "starts=5", "seconds=8", "workers=1",
    )  # fmt: skip
    outcome = run(study, settings, tmp_path, Console(quiet=True))
    rows = {row["row"]: row for row in outcome.table}
    assert rows["teacher"]["agreement"] == 1.0
    assert rows["sequencing"]["starts"] == 5
    assert (tmp_path / "figures" / "animation_sequencing.gif").is_file()
    spoken = set(pd.read_parquet(tmp_path / "paths" / "sequencing.parquet").speaker)
    assert spoken <= {"retreat", "seek_light", "avoid", "cruise"}
    near, far = [[9.0, 9.0, 0.01]], [[9.0, 9.0, 1.0]]
    rules = Precedence(settings.behaviours)
    assert rules(np.array(near)).tolist() == [[-1.0, -0.5]]
    assert rules(np.array(far)).tolist() == sim.Teacher()(np.array(far)).tolist()
    assert Precedence(["avoid"])(np.array(far)).tolist() == [[0.0, 0.0]]
    with pytest.raises(ValueError, match="no demonstration shows 'avoid'; give more of them"):
        Precedence(["avoid"]).apart(Demonstrations(far, [[0.0, 0.0]] * len(far)))


def test_rows_with_a_memory_are_not_asked_once_for_all() -> None:
    assert line_of("sequencing").memory
    assert not line_of("bundle").memory
    with pytest.raises(ValueError, match="record=random_fourier: damage asks each condition once"):
        check_all(damage.study, composed(damage.study, "record=random_fourier"))
    with pytest.raises(ValueError, match="cannot be damaged"):
        check_all(damage.study, composed(damage.study, "rows=[sequencing]"))
    with pytest.raises(ValueError, match="nearest_neighbour cannot be damaged"):
        check_all(damage.study, composed(damage.study, "rows=[nearest_neighbour]"))


def test_flipped_elements_are_counted_in_all_vectors_of_a_row() -> None:
    what = shown()
    for name, count in (("joint_program", 1), ("plain_sum", 1), ("gated", 4), ("masked_priority", 6)):
        made = ROWS[name].make(what, 0)
        copy = damage.flipped(made, 0.25, (0, 1))
        before, after = (torch.stack(damage.vectors(one)).double() for one in (made, copy))
        assert before.shape == (count, 512)
        changed = (before != after).flatten()
        assert torch.equal(after.flatten()[changed], -before.flatten()[changed])
        hit = damage.flipped(made, 1.0, (0, 1))
        assert torch.equal(torch.stack(damage.vectors(hit)).double(), -before)
        # Elements of 0 are flipped, too, which nobody sees.
        assert 0 < changed.sum() <= round(0.25 * before.numel())


def test_damage_leaves_less(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(in_bullet, "effects", lambda *given: {"planar": [1, 0, -1, 0, 1]})
    settings = composed(
        damage.study, "vsa.dim=512", "demonstrations=6", "heldout=4", "codebooks=2", "seconds=12", "workers=1",
        "rows=[joint_program,plain_sum]", "flips=[0.1,0.5]", "noise=[0.2]", "starts=6", "bullet_rows=[plain_sum]",
        "bullet_flips=[0]", "bullet_noise=[0.2]",
    )  # fmt: skip
    outcome = run(damage.study, settings, tmp_path, Console(quiet=True))
    found = {(row["row"], row["damage"], row["level"]): row for row in outcome.table}
    assert len(found) == 2 * (3 + 2)
    for name in settings.rows:
        whole = found[name, damage.FLIPPED, 0.0]
        assert whole["agreement"] == found[name, damage.NOISY, 0.0]["agreement"]
        assert found[name, damage.FLIPPED, 0.1]["agreement"] > found[name, damage.FLIPPED, 0.5]["agreement"]
        assert found[name, damage.NOISY, 0.2]["agreement"] < whole["agreement"]
        assert found[name, damage.FLIPPED, 0.5]["kept"] == pytest.approx(
            found[name, damage.FLIPPED, 0.5]["agreement"] / whole["agreement"]
        )
    assert (tmp_path / "figures" / "damage.png").is_file()
    assert "each row survives flipped elements: `joint_program`" in damage.study.headline(outcome)
    # In the physics engine what is not damaged is one row; its starts belong to the codebooks in turn.
    shown = damage.tables(outcome)[1].rows
    assert [(row["row"], row["damage"], row["level"]) for row in shown] == [
        ("plain_sum", None, 0.0),
        ("plain_sum", damage.NOISY, 0.2),
    ]
    counts = outcome.records.loc[(outcome.records.row == "plain_sum") & (outcome.records.level == 0.2)]
    assert counts[["planar_same", "planar_gained", "planar_lost"]].to_numpy().tolist() == [[0, 2, 1], [2, 0, 0]]


def test_a_behaviour_tree_is_a_priority() -> None:
    what = shown()
    bank = what.bank(0, MASKED)
    readings = what.train.sensors[::7]
    for by in ("familiarity", "similarity"):
        tree, priority = BehaviourTree(bank, by)(readings), Priority(bank, by=by)
        found = np.stack([getattr(bank[name](readings), by).numpy() for name in bank], 1)
        known = (found >= np.array(priority.thresholds)).any(1)
        assert known.sum() > 20
        assert tree.speaker is not None
        speaker = priority(readings).speaker
        assert speaker is not None
        assert tree.speaker.numpy()[known].tolist() == speaker.numpy()[known].tolist()


def test_a_tree_lets_the_last_one_speak_where_nobody_knows() -> None:
    bank = BehaviourBank(shown().space(0))
    for name, row in (("a", [0.1, 0.1, 0.1]), ("b", [3.0, 3.0, 0.9])):
        bank.learn(name, Demonstrations([row], [[1.0, 1.0]]), OneShot())
    for part in (bank["a"], bank["b"]):
        part.threshold = 0.99
    speaker = BehaviourTree(bank)([[0.1, 0.1, 0.1], [2.0, 0.4, 0.5]]).speaker
    assert speaker is not None
    assert speaker.tolist() == [0, 1]
