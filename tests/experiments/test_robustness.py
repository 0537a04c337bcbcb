"""The damage study: what is damaged is exactly what was asked for, and the command reports it."""

import io
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow.parquet as pq
import pytest
import torch
from commands import only, output_of, results
from kits import composed
from rich.console import Console

import sim
from behaviours import Demonstrations
from experiments.kit.run import check_all, load, run
from experiments.main import main
from experiments.robustness.baselines import DamagedNetwork, DamagedTree, Network, Tree, positions
from experiments.robustness.damage import DAMAGES, PARTS, Array, Damage, Learner
from experiments.robustness.page import answers, survival
from experiments.robustness.programs import Program
from experiments.robustness.study import LEARNERS, Robustness, SharedStarts, cells, study

SMALL = ("vsa.dim=500", "encoder.bins=8", "encoder.span=2", "one_shot.encoder.bins=8", "mlp_epochs=15", "hidden=8")
READINGS = np.random.default_rng(5).uniform([0, 0, 0], [sensor.high for sensor in sim.SENSORS], (300, 3))
READINGS[:150, 0] = sim.SENSORS[0].high  # dark to the left, to the right, to both
READINGS[80:220, 1] = sim.SENSORS[1].high


def settings(*overrides: str) -> Robustness:
    return cast(Robustness, composed(study, *SMALL, *overrides))


@cache
def learner(name: str) -> Learner:
    return LEARNERS[name].learn(settings(), Demonstrations(READINGS, sim.Teacher()(READINGS)))


def damage(kind: str, share: float, *seed: int) -> Damage:
    return Damage(kind, share, 3.0, seed or (0, 0))


CASES = [(name, part) for name in ("default", "one_shot", "hand_written") for part in PARTS]
CASES += [("mlp", "parameters"), ("decision_tree", "parameters")]


@pytest.mark.parametrize("kind", DAMAGES)
@pytest.mark.parametrize("share", [0.0, 0.1, 0.333, 1.0])
def test_exactly_the_share_is_damaged_and_the_rest_stays(kind: str, share: float) -> None:
    arrays = [Array(np.arange(1.0, 42.0)), Array(np.full((30, 3), 0.25), mirror=1.0)]
    damaged = damage(kind, share)(arrays)
    changed = [(new != array.values).reshape(len(new), -1) for new, array in zip(damaged, arrays, strict=True)]
    assert sum(int(rows.any(1).sum()) for rows in changed) == int(share * 71 + 0.5)
    # An element of several numbers is damaged as a whole.
    assert np.array_equal(changed[1].any(1), changed[1].all(1))
    assert np.array_equal(arrays[0].values, np.arange(1.0, 42.0))
    if kind == "flip":
        assert np.array_equal(np.abs(damaged[0]), arrays[0].values)
        assert set(np.unique(damaged[1])) <= {0.25, 0.75}
    if kind == "zero":
        assert all((new[rows.any(1)] == 0).all() for new, rows in zip(damaged, changed, strict=True))


def test_noise_is_relative_to_the_array_that_it_falls_on() -> None:
    small, large = damage("noise", 1.0)([Array(np.full(20_000, 0.1)), Array(np.full(20_000, -10.0))])
    assert np.std(small - 0.1) == pytest.approx(0.3, rel=0.03)
    assert np.std(large + 10) == pytest.approx(30, rel=0.03)
    assert abs(np.mean(large + 10)) < 1


def test_the_same_seed_damages_the_same_and_a_larger_share_damages_more_of_it() -> None:
    array = [Array(np.ones(1000))]
    for kind in DAMAGES:
        assert np.array_equal(damage(kind, 0.3, 7, 1)(array), damage(kind, 0.3, 7, 1)(array))
        assert not np.array_equal(damage(kind, 0.3, 7, 1)(array), damage(kind, 0.3, 7, 2)(array))
        assert not np.array_equal(damage(kind, 0.3, 7, 1)(array), damage(kind, 0.3, 7, 1)(array, key=(1,)))
    (some,), (more,) = damage("zero", 0.2)(array), damage("zero", 0.4)(array)
    assert (more[some == 0] == 0).all()
    (flipped,) = damage("flip", 0.2)(array)
    assert np.array_equal(flipped < 0, some == 0)


@pytest.mark.parametrize(("name", "part"), CASES)
def test_no_damage_changes_nothing(name: str, part: str) -> None:
    one = learner(name)
    for kind in DAMAGES:
        commands = one.damaged(part, damage(kind, 0.0))(READINGS)
        if isinstance(one, Program):
            expected = one.behaviour(READINGS).commands.numpy()
        elif isinstance(one, Network):
            expected = one.classes[np.asarray(one.model.predict_proba((READINGS - one.mean) / one.scale)).argmax(-1)]
        else:
            assert isinstance(one, Tree)
            expected = one.classes[np.asarray(one.model.predict(positions(READINGS)), dtype=np.int64)]
        assert np.array_equal(commands, expected)


@pytest.mark.parametrize(("name", "part"), CASES)
@pytest.mark.parametrize("kind", DAMAGES)
def test_an_answer_does_not_depend_on_what_is_asked_together(name: str, part: str, kind: str) -> None:
    one, what = learner(name), damage(kind, 0.4)
    together = one.damaged(part, what)(READINGS)
    policy = one.damaged(part, what)
    alone = np.concatenate([policy(row[None]) for row in READINGS[:150]])
    assert np.array_equal(alone, together[:150])


@pytest.mark.parametrize("part", PARTS)
def test_heavy_damage_is_felt(part: str) -> None:
    one = learner("default")
    right = sim.Teacher()(READINGS)
    shares = [(one.damaged(part, damage("flip", s))(READINGS) == right).all(1).mean() for s in (0.0, 0.5)]
    assert shares[1] < shares[0] - 0.15


@pytest.mark.parametrize("part", ["program", "query"])
def test_flipping_all_of_the_program_or_the_query_turns_the_order_of_the_results_around(part: str) -> None:
    one = learner("default")
    assert isinstance(one, Program)
    bins = one.space.cells(READINGS)
    scores = torch.stack(
        [one.space.encode(bins).double() @ (one.behaviour.program * item).double() for item in one.items], -1
    )
    worst = one.damaged(part, damage("flip", 1.0)).results(bins)
    tied = (scores == scores.amin(-1, keepdim=True)).sum(-1) > 1
    assert not tied.all()
    assert np.array_equal(worst[~tied], scores.argmin(-1).numpy()[~tied])


def test_the_codebooks_of_others_stay_whole_and_missing_readings_keep_their_entry() -> None:
    one = learner("default")
    assert isinstance(one, Program)
    before = one.space.encoder.table.clone(), one.items.clone()
    damaged = one.damaged("codebooks", damage("noise", 0.25))
    assert torch.equal(one.space.encoder.table, before[0])
    assert torch.equal(one.items, before[1])
    table = damaged.space.encoder.table
    assert torch.equal(table[:, -1], before[0][:, -1].float())
    hit = int((table != before[0]).sum()) + int((damaged.items != one.items).sum())
    assert hit == one.elements("codebooks") // 4 == (3 * 8 * 500 + len(one.items) * 500) // 4


def test_each_condition_is_damaged_in_its_own_way() -> None:
    one = learner("default")
    assert isinstance(one, Program)
    bins = one.space.cells(READINGS)
    query = one.damaged("query", damage("flip", 0.45))
    # Asked in another order and company, each condition gets the same answer.
    assert np.array_equal(query.results(bins).tolist(), query.results(bins.flip(0))[::-1].tolist())
    assert (query.results(bins) != one.damaged("query", damage("flip", 0.45, 1, 1)).results(bins)).any()


def test_the_elements_of_a_network_are_all_its_weights_and_biases() -> None:
    one = learner("mlp")
    assert isinstance(one, Network)
    assert one.elements("parameters") == 3 * 8 + 8 + 8 * 3 + 3
    policy = one.damaged("parameters", damage("zero", 0.5))
    assert isinstance(policy, DamagedNetwork)
    zeros = sum(int((layer == 0).sum()) for layer in policy.layers)
    assert zeros - sum(int((layer == 0).sum()) for layer in one.layers) == 30


def test_the_elements_of_a_tree_are_its_thresholds_and_its_leaves() -> None:
    one = learner("decision_tree")
    assert isinstance(one, Tree)
    whole = one.model.tree_
    assert one.elements("parameters") == whole.node_count
    policy = one.damaged("parameters", damage("flip", 1.0))
    assert isinstance(policy, DamagedTree)
    flipped = policy.model.tree_
    assert flipped.threshold[one.inner] == pytest.approx(1 - np.array(whole.threshold)[one.inner])
    # Every leaf decides otherwise, and the tree that was learned stays whole.
    decisions = [np.array(tree.value[one.leaves, 0]).argmax(-1) for tree in (flipped, whole)]
    assert (decisions[0] != decisions[1]).all()
    assert (np.array(whole.value[:, 0]) >= 0).all()


def test_copies_share_the_starts() -> None:
    one = learner("default")
    copies = [one.damaged("program", damage("flip", 0.5, 0, draw)) for draw in range(2)]
    together = sim.replay(SharedStarts(copies), READINGS, np.arange(len(READINGS)))
    assert np.array_equal(together[0::2], copies[0](READINGS[0::2]))
    assert np.array_equal(together[1::2], copies[1](READINGS[1::2]))
    assert (together[0::2] != copies[1](READINGS[0::2])).any()


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("learners=[nobody]", "learners: there is no 'nobody'; choose from default, "),
        ("parts=[]", "parts is empty; choose from program, "),
        ("damages=[flip,flip]", "damages names 'flip' 2 times"),
        ("damages=[melt]", "damages: there is no 'melt'; choose from flip, zero, noise"),
        ("shares=[0.1,0.2]", "shares begin with 0"),
        ("shares=[0,1.5]", r"shares=\[0,1.5\]: expected a number from 0 to 1"),
        ("drive_shares=[0.15]", r"drive_shares are some of the shares .*0.15"),
        ("draws=0", "draws=0: expected 1 or more"),
        ("kept=0", "kept=0: expected more than 0 and at most 1"),
        # Programs without signs, a rule that does not fit, and codes without a table.
        ("vsa=bsc", "BSC has none; try vsa=map_c"),
        ("one_shot.rule.name=guess", "no learning rule 'guess'"),
        ("record=threshold_features", "threshold_features has none .* try encoder=level record=product"),
    ],
)
def test_wrong_settings_are_named(override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, settings("learners=[default,one_shot]", override))


def test_a_rule_that_cannot_train_the_architecture_is_refused() -> None:
    with pytest.raises(ValueError, match="the rule least_squares cannot train programs of HRR"):
        check_all(study, settings("vsa=hrr", "rule=least_squares"))


def test_an_undamaged_learner_is_measured_once_and_robots_drive_first() -> None:
    found = cells(settings("learners=[default,mlp]", "shares=[0,0.1,0.3]", "drive_shares=[0,0.3]"))
    assert [cell["learner"] for cell in found if not cell["share"]] == ["teacher", "default", "mlp"]
    driven = [cell["share"] in (0, 0.3) for cell in found]
    assert driven == sorted(driven, reverse=True)
    assert len(found) == 3 + (3 + 1) * 3 * 2


def test_what_is_survived_follows_from_the_numbers() -> None:
    values = {0.0: 0.9, 0.1: 0.88, 0.2: 0.5, 0.3: 0.89}
    table: list[dict[str, Any]] = [
        {
            "learner": "default",
            "part": "program",
            "damage": "flip",
            "share": share,
            "agreement": value,
            "success_rate": None,
        }
        for share, value in values.items()
    ]
    (row,) = survival(table, kept=0.95)
    # What comes back after it fell was not survived.
    assert (row["agreement"], row["success_rate"]) == (0.1, None)
    assert survival(table, kept=0.5)[0]["agreement"] == 0.3
    assert survival(table, kept=0.99)[0]["agreement"] == 0.0
    (sentence,) = answers(table, 0.95)
    assert "`default` program 10%" in sentence


TINY = (
    *SMALL,
    "demonstrations=4",
    "starts=4",
    "seconds=12",
    "shares=[0,0.5]",
    "drive_shares=[0,0.5]",
    "draws=2",
    "damages=[flip]",
    "parts=[program]",
    "learners=[default,decision_tree]",
    "workers=1",
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("robustness")
    return folder, output_of(folder, "robustness", *TINY)


def test_the_command_writes_table_records_and_page(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    content = results(folder)
    assert content["table"][0]["learner"] == "teacher"
    assert content["metrics"]["teacher.success_rate"] == content["table"][0]["success_rate"]
    rows = {(row["learner"], row["part"], row["share"]): row for row in content["table"][1:]}
    assert list(rows) == [
        (name, part, share)
        for name, part in (("default", "program"), ("decision_tree", "parameters"))
        for share in (0.0, 0.5)
    ]
    records = pq.read_table(only(folder, "records.parquet")).to_pylist()
    for (name, part, share), row in rows.items():
        own = [r for r in records if (r["learner"], r["part"], r["share"]) == (name, part, share)]
        assert len(own) == (2 if share else 1)
        assert row["agreement"] == pytest.approx(np.mean([r["agreement"] for r in own]))
        assert row["agreement_min"] == min(r["agreement"] for r in own)
        assert row["episodes"] == sum(r["episodes"] for r in own) == 4
        assert row["success_rate"] * 4 == sum(r["successes"] for r in own)
        assert all(r["damaged"] == int(share * r["elements"] + 0.5) for r in own)
        assert content["metrics"][f"{name}.{part}.flip.{share:g}.agreement"] == row["agreement"]
        assert content["metrics"][f"{name}.{part}.elements"] == own[0]["elements"]
    assert rows["decision_tree", "parameters", 0.0]["agreement"] > 0.9
    assert rows["default", "program", 0.5]["agreement"] < rows["default", "program", 0.0]["agreement"]
    assert "results.json" in printed
    page = only(folder, "report.html").read_text()
    assert page.count("data:image/png;base64,") == 3
    assert {path.name for path in folder.rglob("*.png")} == {"agreement.png", "success_rate.png", "robustness.png"}
    assert "Shares that are survived" in page
    assert "How much there is to damage" in page


def test_the_same_seed_gives_the_same_results_in_other_batches(finished: tuple[Path, str], tmp_path: Path) -> None:
    config = settings(*TINY, "robots=3")
    again = run(study, config, tmp_path, Console(file=io.StringIO()))
    before = results(finished[0])
    assert again.table == before["table"]
    assert again.metrics == before["metrics"]
    # The page can be drawn from the files alone.
    assert load(tmp_path)[1].table == again.table


def test_a_wrong_setting_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")  # which the command changes
    with pytest.raises(SystemExit) as exit_:
        main(["robustness", "damages=[melt]"])
    assert exit_.value.code == 1
    assert capsys.readouterr().err == "robustness: damages: there is no 'melt'; choose from flip, zero, noise\n"
    assert not list(tmp_path.rglob("results.json"))
