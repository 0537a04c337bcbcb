"""Behaviours as graphs: compiled, exported, and run by onnxruntime without Python in between."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import onnxruntime
import pytest
import torch
from robots import encoder, protected, random_pairs, same_bits, space
from torch import nn

import torchvsa
from behaviours import (
    Actuator,
    BehaviourBank,
    BehaviourClassifier,
    Bundle,
    Demonstrations,
    ErrorDriven,
    Gradient,
    OneShot,
    Priority,
    Recall,
    Schema,
    Sensor,
    Space,
)
from behaviours import onnx as module
from behaviours.onnx import OUTPUTS, to_onnx
from torchvsa.encoders import ThresholdFeatures

BATCH = ({0: torch.export.Dim("batch")},)


@pytest.fixture(autouse=True)
def forget_graphs() -> Iterator[None]:
    yield
    torch.compiler.reset()


def queries() -> torch.Tensor:
    """Readings that were shown, some that were not, and some with gaps."""
    gaps = [[math.nan, 1, 2], [0, math.nan, 20], [math.nan] * 3, [19.99, 0, 7]]
    return torch.cat([random_pairs(12).sensors, torch.tensor(gaps, dtype=torch.float64)])


def same(a: Recall, b: Recall) -> bool:
    # As numbers: a graph may write the other of two equal zeros, or another NaN.
    pairs = [(x, y) for x, y in zip(a, b, strict=True) if x is not None or y is not None]
    return all(
        x is not None and y is not None and x.dtype == y.dtype and torch.equal(x.nan_to_num(-7), y.nan_to_num(-7))
        for x, y in pairs
    )


def alike(a: Recall, b: Recall) -> bool:
    return torch.equal(a.commands.nan_to_num(-7), b.commands.nan_to_num(-7)) and all(
        torch.allclose(x, y, atol=1e-5) for x, y in zip(a[1:4], b[1:4], strict=True)
    )


def compiled(function: Any, backend: str = "aot_eager") -> Callable[..., Any]:
    return cast(Callable[..., Any], torch.compile(function, fullgraph=True, backend=backend))


def policies() -> list[nn.Module]:
    bank = BehaviourBank(space(256))
    bank.learn("seek", random_pairs(12), OneShot())
    bank.learn("avoid", random_pairs(9, seed=3), ErrorDriven())
    return [Bundle(bank), Priority(bank, ["avoid", "seek"])]


# In MAP-B and MAP-I recall runs the lines that it runs in MAP-C; `test_graphs` compiles what they do otherwise.
DIFFERENT = ["MAP-C", "HRR", "FHRR", "BSC"]


@pytest.mark.parametrize("vsa", DIFFERENT)
def test_recall_compiles_whole(vsa: str) -> None:
    behaviour = ErrorDriven().fit(space(256, vsa), random_pairs(12))
    assert same(compiled(behaviour)(queries()), behaviour(queries()))


def test_queries_compile_whole() -> None:
    behaviour = ErrorDriven().fit(space(256), random_pairs(12))
    conditions = behaviour.space.encode(behaviour.space.cells(random_pairs(12).sensors))
    assert same(compiled(behaviour.query)(conditions), behaviour.query(conditions))


@pytest.mark.parametrize("number", [0, 1])
def test_policies_compile(number: int) -> None:
    policy = policies()[number]
    assert same(compiled(policy)(queries()), policy(queries()))


def test_a_policy_is_exported() -> None:
    policy = policies()[1]  # the other kind becomes an ONNX file below
    exported = torch.export.export(policy, (queries(),), dynamic_shapes=BATCH).module()
    assert same(exported(queries()[:3]), policy(queries()[:3]))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of its own parts
def test_inductor_recalls_the_same_commands() -> None:
    behaviour = ErrorDriven().fit(space(512), random_pairs(12))
    assert same(compiled(behaviour, "inductor")(queries()), behaviour(queries()))


def test_a_graph_clips_what_it_cannot_refuse() -> None:
    behaviour = OneShot().fit(space(256), random_pairs(12))
    outside = torch.tensor([[21.0, -3, 1e9], [math.inf, -math.inf, 3]], dtype=torch.float64)
    for rows in outside.split(1):
        with pytest.raises(ValueError, match="sensor 'left' reads"):
            behaviour(rows)
    bounds = behaviour(torch.tensor([[20.0, 0, 20], [20, 0, 3]]))
    assert same(compiled(behaviour)(outside), bounds)
    exported = torch.export.export(behaviour, (queries(),), dynamic_shapes=BATCH).module()
    assert same(exported(outside), bounds)


@pytest.mark.parametrize("vsa", DIFFERENT)
def test_an_exported_behaviour_answers_any_batch(vsa: str) -> None:
    made = space(256, vsa, values="level", protection={"name": "self_shift", "width": "sum"})
    behaviour = ErrorDriven().fit(made, random_pairs(12))
    exported = torch.export.export(behaviour, (queries(),), dynamic_shapes=BATCH).module()
    for rows in (queries(), queries()[:1], queries().repeat(9, 1)):
        assert (same if made.vsa.integer else alike)(exported(rows), behaviour(rows))


def answers(path: Path, readings: Any) -> list[torch.Tensor]:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(path, options)
    assert [x.name for x in session.get_inputs()] == ["readings"]
    assert [x.name for x in session.get_outputs()] == list(OUTPUTS[: len(session.get_outputs())])
    found = session.run(None, {"readings": np.asarray(readings, dtype=np.float64)})
    return [torch.from_numpy(part) for part in cast(list[np.ndarray], found)]


def corral() -> tuple[Schema, Demonstrations]:
    """Readings and commands like those of the corral: two lights and a distance, with some of them missing."""
    schema = Schema(
        [Sensor("light_left", 0, 4, "m"), Sensor("light_right", 0, 4, "m"), Sensor("front", 0, 1.5, "m")],
        [Actuator("left_wheel", -1, 1, levels=3), Actuator("right_wheel", -1, 1, levels=3)],
    )
    rng = np.random.default_rng(0)
    readings = rng.uniform(0, 1, (120, 3)) * [4, 4, 1.5]
    readings[:9] = [[0, 4, 1.5], [4, 0, 0], [4, 4, 1.5], [2, 2, 0.75], [0, 0, 0], *[[1, 3, 0.3]] * 4]
    turn = np.sign(readings[:, :1] - readings[:, 1:2])
    commands = np.where(
        readings[:, 2:] < 0.4, [[1.0, -1.0]], np.concatenate([1 + turn.clip(max=0), 1 - turn.clip(0)], 1)
    )
    readings[9:40:3, 1] = np.nan
    readings[10:40:3, :2] = np.nan
    return schema, Demonstrations(readings, commands)


# An export takes four seconds: each type, record, value encoder and protection once, not each with each.
CASES = {
    "integers": ("int8", {"bins": 16}, "none"),
    "floats of level and bind": ("float32", {"bins": 16, "values": "level", "combine": "product"}, "none"),
    "protected": ("int8", {"bins": 8, "values": "level"}, "self_shift"),
}


@pytest.mark.parametrize("case", [pytest.param(c, marks=() if c == "integers" else pytest.mark.slow) for c in CASES])
def test_onnxruntime_gives_the_same_commands(case: str, tmp_path: Path) -> None:
    dtype, options, protection = CASES[case]
    schema, shown = corral()
    vsa = torchvsa.architecture("MAP-C", 512, dtype)
    made = Space(schema, encoder(vsa, **options), protection=protected(vsa, protection))
    behaviour = ErrorDriven().fit(made, shown)
    path = tmp_path / "corral.onnx"
    path.write_bytes(b"what was there before")
    behaviour.memory.train(False)
    assert to_onnx(behaviour, path) == path
    assert (behaviour.training, behaviour.memory.training) == (True, False)
    assert [p.name for p in tmp_path.iterdir()] == ["corral.onnx"]
    meta = onnxruntime.InferenceSession(path).get_modelmeta().custom_metadata_map
    assert json.loads(meta["sensors"]) == ["light_left", "light_right", "front"]
    assert json.loads(meta["actuators"]) == ["left_wheel", "right_wheel"]
    blind = torch.cat([shown.sensors, torch.full((1, 3), torch.nan, dtype=torch.float64)])
    for rows in (blind, blind[:1]):
        found, recall = Recall(*answers(path, rows)), behaviour(rows)
        assert same(found, recall) if dtype == "int8" else alike(found, recall)
    assert answers(path, blind)[0][-1].isnan().all()
    # A live reading out of range counts as the nearest bound.
    assert answers(path, [[9, -2, math.inf]])[0].tolist() == behaviour([[4, 0, 1.5]]).commands.tolist()


def test_a_classifier_in_onnxruntime(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    X = rng.normal(size=(300, 3))  # noqa: N806
    X[::11, 1] = np.nan
    y = np.array(["stop", "left", "right"])[(X[:, 0] > 0).astype(int) + (X[:, 2] > 0.5)]
    model = BehaviourClassifier(dim=500, bins=64, oblique=0, epochs=20, random_state=0).fit(X, y)
    path = to_onnx(model, tmp_path / "classes.onnx")
    meta = onnxruntime.InferenceSession(path).get_modelmeta().custom_metadata_map
    assert json.loads(meta["labels"]) == {json.loads(meta["actuators"])[0]: ["left", "right", "stop"]}
    assert Schema.from_dict(json.loads(meta["schema"])) == model.behaviour_.space.schema
    commands = answers(path, X)[0][:, 0].numpy().astype(int)
    np.testing.assert_array_equal(model.classes_[commands], model.predict(X))
    # Beyond the training rows, and on an edge between two bins.
    features = cast(ThresholdFeatures, model.behaviour_.space.encoder)
    sensor = model.behaviour_.space.schema.sensors[0]
    edge = sensor.low + float(features.edges[0, 7]) * (sensor.high - sensor.low)
    odd = np.array([[99.0, -99, 0], [edge, 0, 0]])
    np.testing.assert_array_equal(answers(path, odd)[0].numpy(), model.behaviour_(odd).commands.numpy())
    mixed = BehaviourClassifier(dim=500, oblique=0.5, epochs=20, random_state=0).fit(X, y)
    found = answers(to_onnx(mixed, tmp_path / "sums.onnx"), X)[0][:, 0].numpy().astype(int)
    np.testing.assert_array_equal(mixed.classes_[found], mixed.predict(X))


@pytest.mark.slow
def test_readings_and_commands_in_float32(tmp_path: Path) -> None:
    schema, shown = corral()
    behaviour = ErrorDriven().fit(Space(schema, encoder(torchvsa.architecture("MAP-C", 512, "int8"), bins=16)), shown)
    labels = {"left_wheel": list(range(schema.actuators[0].levels))}
    path = to_onnx(behaviour, tmp_path / "narrow.onnx", dtype=torch.float32, labels=labels)
    session = onnxruntime.InferenceSession(path)
    assert session.get_inputs()[0].type == session.get_outputs()[0].type == "tensor(float)"
    readings = shown.sensors.to(torch.float32)
    commands, similarity, *_ = session.run(None, {"readings": readings.numpy()})
    expected = behaviour(readings.double())
    assert torch.equal(torch.from_numpy(commands), expected.commands.float())
    assert torch.equal(torch.from_numpy(similarity), expected.similarity)
    assert json.loads(session.get_modelmeta().custom_metadata_map["labels"]) == labels


def test_wrong_labels_and_types_are_refused_before_any_work(tmp_path: Path) -> None:
    behaviour = OneShot().fit(space(64), random_pairs(3))
    name, levels = behaviour.space.schema.actuators[0].name, behaviour.space.schema.actuators[0].levels
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"dtype": torch.float16}, "float64 or torch.float32"),
        ({"labels": {"wheel?": [1]}}, "labels has 'wheel\\?'"),
        ({"labels": {name: ["one"] * (levels + 1)}}, f"has {levels} levels"),
    ]
    for options, why in wrong:
        with pytest.raises(ValueError, match=why):
            to_onnx(behaviour, tmp_path / "x.onnx", **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_what_else_can_be_written(tmp_path: Path) -> None:
    shown = random_pairs(12)
    bank = BehaviourBank(space(256, "MAP-B"))
    bank.learn("integers", shown, ErrorDriven())
    bank.learn("floats", random_pairs(9, seed=3), Gradient(epochs=5))
    modules = {
        "HRR": OneShot().fit(space(256, "HRR", protection="fixed_shift"), shown),
        "BSC": OneShot().fit(space(256, "BSC", protection="none"), shown),
        "policy of MAP-B": Bundle(bank),
    }
    for name, behaviour in modules.items():
        recall = behaviour(queries())
        found = Recall(*answers(to_onnx(cast(Any, behaviour), tmp_path / name), queries()))
        assert alike(found, recall), name
        assert (found.speaker is None) == (recall.speaker is None)
        assert recall.speaker is None or torch.equal(cast(torch.Tensor, found.speaker), recall.speaker)


def test_a_folder_that_is_not_there_is_told_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module.torch.export, "export", lambda *_, **__: pytest.fail("exported before it was told"))
    with pytest.raises(OSError, match=r"cannot write .*behaviour\.onnx"):
        to_onnx(OneShot().fit(space(64), random_pairs(3)), tmp_path / "nowhere" / "behaviour.onnx")


def test_complex_codes_are_refused(tmp_path: Path) -> None:
    behaviour = OneShot().fit(space(64, "FHRR"), random_pairs(3))
    with pytest.raises(ValueError, match=r"ONNX has no complex numbers, so that FHRR\(dim=64"):
        to_onnx(behaviour, tmp_path / "x")
    assert list(tmp_path.iterdir()) == []


def test_without_the_packages_the_error_says_what_to_install(monkeypatch: Any, tmp_path: Path) -> None:
    def missing(*_: Any, **__: Any) -> None:
        raise ModuleNotFoundError("No module named 'onnxscript'", name="onnxscript")

    monkeypatch.setattr(module.torch.onnx, "export", missing)
    with pytest.raises(ImportError, match=r"pip install 'torchvsa\[onnx\]' \(No module named 'onnxscript'\)"):
        to_onnx(OneShot().fit(space(64), random_pairs(3)), tmp_path / "x")


def test_a_state_comes_back_into_a_copy() -> None:
    behaviour = ErrorDriven().fit(space(256), random_pairs(12)).trainable()
    other = OneShot().fit(space(256, seed=3), random_pairs(12)).trainable()
    other.load_state_dict(behaviour.state_dict())
    assert same_bits(other.program.detach(), behaviour.program.detach())
    assert same(other(queries()), behaviour(queries()))
