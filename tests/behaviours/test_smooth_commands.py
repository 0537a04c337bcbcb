"""Behaviours whose commands are between the levels: alone, in sums, frozen, mirrored, saved and exported."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors import safe_open

import torchvsa
from behaviours import (
    Actuator,
    Behaviour,
    BehaviourBank,
    Blending,
    Bundle,
    Demonstrations,
    ErrorDriven,
    Gated,
    Gradient,
    LeastSquares,
    MotorSchema,
    OneShot,
    Priority,
    Schema,
    Sensor,
    Space,
    explain,
    recognise,
    switching_weights,
)
from behaviours.storage import load_tensors, save_tensors
from torchvsa import HRR, MAP

SENSORS = [Sensor("angle", 0, 6, unit="rad"), Sensor("size", 0, 1)]
ACTUATORS = [Actuator("left", -1, 1, levels=3), Actuator("right", -2, 6, levels=3)]
ENDS = torch.tensor([[-1.0, -2.0], [1.0, 6.0]], dtype=torch.float64)


def readings(count: int, seed: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(count, 2, generator=generator, dtype=torch.float64) * torch.tensor([6.0, 1.0])


def teacher(rows: torch.Tensor) -> torch.Tensor:
    return torch.stack([0.8 * rows[:, 0].sin(), 2 + 3 * rows[:, 0].cos() * rows[:, 1]], 1)


SHOWN = Demonstrations(readings(300, 0), teacher(readings(300, 0)))
ASKED = readings(200, 1)
RULE = LeastSquares(smooth=True)


def bank(vsa: Any = None, **options: Any) -> BehaviourBank:
    made = BehaviourBank(Space(Schema(SENSORS, ACTUATORS), vsa=MAP(1000, dtype=torch.int8) if vsa is None else vsa))
    made.learn("smooth", SHOWN, LeastSquares(smooth=True, **options))
    return made


def unclipped(behaviour: Behaviour, rows: torch.Tensor) -> torch.Tensor:
    """The commands as Algorithm 2 would decode them without a clean-up, by unbinding; in NumPy."""
    conditions = behaviour.space.encode(behaviour.space.cells(rows)).double().numpy()
    noisy = conditions * behaviour.program.detach().double().numpy()
    roles = behaviour.space.result_encoder.roles.double().numpy()
    shares = noisy @ (roles / np.linalg.norm(roles, axis=1, keepdims=True)).T
    low, high = ENDS.numpy()
    return torch.from_numpy(low + (shares + 1) / 2 * (high - low))


@pytest.mark.parametrize("vsa", [MAP(2000, dtype=torch.int8), MAP(2000), torchvsa.architecture("MAP-B", 2000)], ids=str)
def test_commands_are_between_the_levels_and_near_the_teachers(vsa: Any) -> None:
    made = bank(vsa)
    recall = made["smooth"](ASKED)
    error = (recall.commands - teacher(ASKED)).square().mean(0).sqrt() / (ENDS[1] - ENDS[0])
    assert (error < 0.02).all()
    # Three levels would be off by a sixth of the range, on average.
    assert len(recall.commands.unique(dim=0)) == len(ASKED)
    expected = unclipped(made["smooth"], ASKED).clamp(ENDS[0], ENDS[1])
    torch.testing.assert_close(recall.commands, expected, atol=1e-5, rtol=0)
    assert recall.margin.isinf().all()
    assert torch.equal(made(ASKED)["smooth"].commands, recall.commands)
    assert recall.commands.dtype == torch.float64


def test_the_program_is_the_ridge_solution_for_the_mean_commands() -> None:
    rows = readings(20, 2).repeat(2, 1)
    shown = Demonstrations(rows, torch.cat([teacher(rows[:20]), -teacher(rows[:20]).clamp(-1, 1)]))
    made = BehaviourBank(Space(Schema(SENSORS, ACTUATORS), vsa=MAP(64, dtype=torch.int8)))
    made.learn("smooth", shown, LeastSquares(smooth=True, ridge=0.3))
    space, behaviour = made.space, made["smooth"]
    conditions = space.encode(space.cells(rows)).double().numpy()
    roles = space.result_encoder.roles.double().numpy()
    shares = (2 * (shown.commands - ENDS[0]) / (ENDS[1] - ENDS[0]) - 1).numpy()
    pairs = (conditions[:, None] * roles).reshape(-1, 64)
    system = pairs.T @ pairs + 0.3 * 64 * np.eye(64)
    expected = np.linalg.solve(system, pairs.T @ (8 * shares).ravel())
    np.testing.assert_allclose(behaviour.program.double().numpy(), expected, rtol=1e-3, atol=1e-4)
    assert behaviour.report.samples == 40
    assert behaviour.report.new == len(np.unique(conditions, axis=0))


def test_the_report_counts_what_is_off_by_half_a_level() -> None:
    made = bank(ridge=1e4)
    # So much ridge leaves the middle of the range.
    off = ((unclipped(made["smooth"], SHOWN.sensors) - SHOWN.commands).abs() > torch.tensor([0.5, 2.0])).any(1)
    assert made["smooth"].report.wrong == off.sum() > 50
    assert bank()["smooth"].report.wrong == 0


def test_sums_add_as_forces_do() -> None:
    made = bank()
    made.learn("other", Demonstrations(SHOWN.sensors, SHOWN.commands.flip(0)), RULE)
    a, b = made["smooth"], made["other"]
    middle = ENDS.mean(0)
    for both, expected in (
        (a + b, unclipped(a, ASKED) + unclipped(b, ASKED) - middle),
        ((a + b) / 2, (unclipped(a, ASKED) + unclipped(b, ASKED)) / 2),
        (-a, 2 * middle - unclipped(a, ASKED)),
        (a - b + b, unclipped(a, ASKED)),
    ):
        assert both.smooth
        torch.testing.assert_close(both(ASKED).commands, expected.clamp(ENDS[0], ENDS[1]), atol=1e-3, rtol=0)
    assert repr(a + b).endswith("sum of smooth, other, smooth)")


def test_silence_is_the_middle_of_the_range() -> None:
    made = BehaviourBank(Space(Schema(SENSORS, ACTUATORS)))
    low, high = (SHOWN.where(side) for side in (SHOWN.sensors[:, 0] < 3, SHOWN.sensors[:, 0] >= 3))
    exact = LeastSquares(smooth=True, ridge=1e-3)
    made.learn("low", low, exact, silent=high)
    made.learn("high", high, exact, silent=low)
    error = ((made["low"] + made["high"])(ASKED).commands - teacher(ASKED)).square().mean(0).sqrt()
    assert (error < torch.tensor([0.06, 0.24])).all()
    torch.testing.assert_close(made["low"](high.sensors).commands, ENDS.mean(0).expand(len(high), 2), atol=0.4, rtol=0)


def test_frozen_moved_and_trained_copies_answer_alike() -> None:
    made = bank()["smooth"]
    expected = made(ASKED)
    frozen = made.freeze()
    for got in (frozen(ASKED), made.trainable()(ASKED), made.over(made.space)(ASKED)):
        for one, two in zip(got[:4], expected[:4], strict=True):
            torch.testing.assert_close(one, two, atol=1e-5, rtol=0)
    for row in range(5):
        tick = frozen(ASKED[row : row + 1])
        for one, two in zip(tick[:4], expected[:4], strict=True):
            torch.testing.assert_close(one[0], two[row], atol=1e-5, rtol=0)
    assert made.clipped().smooth
    assert made.scores(ASKED).shape == (200, 2)


def test_ends_are_not_exceeded_and_blind_rows_have_no_command() -> None:
    made = 50 * bank()["smooth"]
    for answer in (made(ASKED), made.freeze()(ASKED), made.freeze()(ASKED[:1])):
        assert ((answer.commands >= ENDS[0]) & (answer.commands <= ENDS[1])).all()
        assert (answer.commands == ENDS[1]).any()
        assert (answer.similarity <= 1).all()
    blind = made(torch.full((1, 2), math.nan))
    assert blind.commands.isnan().all()


def test_the_mirror_image_commands_the_other_side() -> None:
    sensors = [Sensor("light_left", 0, 1), Sensor("light_right", 0, 1)]
    schema = Schema(sensors, [Actuator("left", -1, 1), Actuator("right", -1, 1)])
    made = BehaviourBank(Space(schema, mirror={"light_left": "light_right", "left": "right"}))
    rows = readings(300, 3) / torch.tensor([6.0, 1.0])
    made.learn("seek", Demonstrations(rows, torch.stack([rows[:, 0] - 0.5, rows[:, 1] ** 2], 1)), RULE)
    seek = made["seek"]
    image = seek.mirror()
    torch.testing.assert_close(image(rows.flip(1)).commands, seek(rows).commands.flip(1), atol=1e-5, rtol=0)
    assert image.smooth
    assert image.mirror().smooth


def test_files_keep_it_and_older_releases_refuse_them(tmp_path: Path) -> None:
    made = bank()
    made.add("sum", made["smooth"] + made["smooth"])
    path = made.save(tmp_path / "bank.safetensors")
    again = BehaviourBank.load(path)
    for name in made:
        assert again[name].smooth
        assert torch.equal(again[name](ASKED).commands, made[name](ASKED).commands)
    assert again.save(tmp_path / "again").read_bytes() == path.read_bytes()
    assert _format(path) == 4
    made = BehaviourBank(made.space)
    made.learn("levels", SHOWN, LeastSquares(ridge=0.1))
    assert _format(made.save(tmp_path / "levels")) == 3
    assert not BehaviourBank.load(tmp_path / "levels")["levels"].smooth
    tensors, about = load_tensors(path, "bank")
    about["behaviours"][0]["smooth"] = "yes"
    save_tensors(path, "bank", tensors, about, 4)
    with pytest.raises(ValueError, match="smooth is True or False; got 'yes'"):
        BehaviourBank.load(path)


def _format(path: Path) -> int:
    with safe_open(path, "pt") as file:
        return json.loads(file.metadata()["torchvsa"])["format"]


def test_policies_that_ask_for_answers_take_them() -> None:
    made = bank()
    made.learn("other", Demonstrations(SHOWN.sensors, SHOWN.commands.flip(0)), RULE)
    for policy in (Priority(made, ["smooth", "other"]), Blending(made)):
        commands = policy(ASKED).commands
        assert commands.isfinite().all()
        assert ((commands >= ENDS[0]) & (commands <= ENDS[1])).all()


def test_what_compares_stored_results_refuses_them() -> None:
    made = bank()
    smooth = made["smooth"]
    made.learn("levels", SHOWN, OneShot())
    calls = {
        "a sum with behaviours that are not smooth": lambda: smooth + made["levels"],
        "Bundle": lambda: Bundle(made),
        "Gated": lambda: Gated(made),
        "MotorSchema": lambda: MotorSchema(made),
        "switching_weights": lambda: switching_weights(smooth, smooth, ASKED),
        "recognise": lambda: recognise(made, SHOWN.sensors, SHOWN.commands),
        "explain": lambda: explain(smooth, ASKED[:1]),
        "labels": lambda: smooth.labels(SHOWN.commands),
    }
    for what, call in calls.items():
        with pytest.raises(ValueError, match=f"^{what} compares stored results, (.*) smooth behaviour 'smooth'"):
            call()
    for rule in (OneShot(), ErrorDriven(), Gradient()):
        with pytest.raises(ValueError, match=r"^partial_fit compares stored results"):
            rule.partial_fit(smooth, SHOWN)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"smooth": 1}, "smooth is True or False; got 1"),
        ({"smooth": True, "evidence": 1}, "smooth=True takes contradictions='all' and evidence=0"),
        ({"smooth": True, "contradictions": "first"}, "smooth=True takes contradictions='all' and evidence=0"),
    ],
)
def test_options_that_do_not_go_together(options: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        LeastSquares(**options)


def test_it_needs_real_numbers_like_all_least_squares() -> None:
    with pytest.raises(ValueError, match="least squares needs element-wise binding"):
        bank(HRR(256))


@pytest.mark.slow
def test_onnx_writes_the_same_commands(tmp_path: Path) -> None:
    onnxruntime = pytest.importorskip("onnxruntime")
    from behaviours.onnx import to_onnx

    made = bank(MAP(256, dtype=torch.int8))["smooth"]
    session = onnxruntime.InferenceSession(to_onnx(made, tmp_path / "smooth.onnx"))
    commands, similarity, margin, familiarity = session.run(None, {"readings": ASKED.numpy()})
    recall = made(ASKED)
    np.testing.assert_allclose(commands, recall.commands.numpy(), atol=1e-5)
    np.testing.assert_allclose(similarity, recall.similarity.numpy(), atol=1e-5)
    np.testing.assert_allclose(familiarity, recall.familiarity.numpy(), atol=1e-5)
    assert np.isinf(margin).all()
