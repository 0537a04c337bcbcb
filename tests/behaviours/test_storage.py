"""Files hold every bit, are written whole or not at all, and run nothing when they are read."""

import math
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from robots import KINDS, SCHEMA, encoder, random_pairs, same_bits, space
from safetensors.torch import load
from saved import SAVERS, bank

import torchvsa
from behaviours import BehaviourBank, Demonstrations, OneShot, Space
from behaviours.storage import load_tensors, save_tensors
from torchvsa.encoders import History


def real(tensor: torch.Tensor) -> torch.Tensor:
    return torch.view_as_real(tensor) if tensor.is_complex() else tensor


@pytest.mark.parametrize("vsa", KINDS)
@pytest.mark.parametrize(
    "protection", ["none", {"name": "fixed_shift", "shift": 5}, {"name": "self_shift", "width": "sum"}], ids=str
)
def test_a_bank_comes_back_bit_for_bit(tmp_path: Path, vsa: str, protection: Any) -> None:
    made = bank(vsa, protection, values="level", span=3)
    assert made.save(tmp_path / "bank.safetensors") == tmp_path / "bank.safetensors"
    again = BehaviourBank.load(str(tmp_path / "bank.safetensors"))
    assert again.names == ["seek light", "avoid"]
    assert again.space.config() == made.space.config()
    state, loaded = made.state_dict(), again.state_dict()
    assert list(state) == list(loaded)
    assert all(same_bits(real(value), real(loaded[key])) for key, value in state.items())
    readings = [*random_pairs(9).sensors.tolist(), [math.nan, 1, math.nan], [math.nan] * 3]
    for name in made:
        assert again[name].report == made[name].report
        for before, after in zip(made[name](readings)[:4], again[name](readings)[:4], strict=True):
            # The order of a float sum may depend on where in memory a vector lies; integers leave no room for that.
            before, after = torch.as_tensor(before), torch.as_tensor(after)
            assert (
                same_bits(before, after)
                if made.space.vsa.integer
                else torch.allclose(before, after, atol=1e-6, equal_nan=True)
            )


def test_codebooks_come_from_the_file_and_not_from_the_seed(tmp_path: Path) -> None:
    made = bank()
    made.space.encoder.roles.neg_()
    made.space.encoder.derive()
    loaded = BehaviourBank.load(made.save(tmp_path / "bank")).space.encoder
    assert same_bits(loaded.roles, made.space.encoder.roles)
    assert same_bits(loaded.table, made.space.encoder.table)


def test_an_empty_bank_comes_back(tmp_path: Path) -> None:
    assert len(BehaviourBank.load(BehaviourBank(space(64)).save(tmp_path / "bank"))) == 0


def test_demonstrations_come_back_bit_for_bit(tmp_path: Path) -> None:
    sensors = np.random.default_rng(0).normal(size=(50, 3))
    sensors[::7, 1] = math.nan
    shown = Demonstrations(sensors, np.random.default_rng(1).normal(size=(50, 2)), range(50))
    again = Demonstrations.load(shown.save(tmp_path / "shown.safetensors"))
    for field in ("sensors", "commands", "episodes"):
        assert same_bits(getattr(again, field), getattr(shown, field))


def test_files_are_safetensors_and_never_unpickled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = [bank().save(tmp_path / "bank"), random_pairs(3).save(tmp_path / "shown")]

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("something was unpickled")

    for name in ("load", "loads", "Unpickler"):
        monkeypatch.setattr(pickle, name, refuse)
    monkeypatch.setattr(torch, "load", refuse)
    assert set(load(paths[1].read_bytes())) == {"sensors", "commands", "episodes"}
    BehaviourBank.load(paths[0])
    Demonstrations.load(paths[1])


@pytest.mark.parametrize("save", SAVERS, ids=["bank", "demonstrations"])
@pytest.mark.parametrize("step", ["fsync", "replace", "fdopen"])
def test_a_write_that_fails_leaves_the_old_file(
    save: Callable[[Path], Path], step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "kept"
    path.write_bytes(b"what was there before")

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, step, fail)
    with pytest.raises(OSError, match=r"kept.*No space left on device"):
        save(path)
    assert path.read_bytes() == b"what was there before"
    assert os.listdir(tmp_path) == ["kept"]


@pytest.mark.parametrize("save", SAVERS, ids=["bank", "demonstrations"])
def test_paths_that_cannot_be_written(save: Callable[[Path], Path], tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "nowhere" / "x", tmp_path / "file" / "x", tmp_path / "folder"):
        with pytest.raises(OSError, match=f"cannot write {path}"):
            save(path)
    assert sorted(os.listdir(tmp_path)) == ["file", "folder"]


def test_saving_replaces_and_leaves_no_other_file(tmp_path: Path) -> None:
    random_pairs(3).save(tmp_path / "shown")
    random_pairs(5).save(tmp_path / "shown")
    assert len(Demonstrations.load(tmp_path / "shown")) == 5
    assert os.listdir(tmp_path) == ["shown"]


@pytest.mark.parametrize("how", ["overwritten", "truncated"])
def test_what_was_loaded_does_not_depend_on_the_file_any_more(how: str, tmp_path: Path) -> None:
    path = bank().save(tmp_path / "bank")
    shown = random_pairs(9).save(tmp_path / "shown")
    loaded, rows = BehaviourBank.load(path), Demonstrations.load(shown)
    state = {name: tensor.clone() for name, tensor in loaded.state_dict().items()}
    sensors = rows.sensors.clone()
    for file in (path, shown):
        with file.open("r+b") as handle:  # the same file on the disk, as `cp` writes it
            handle.truncate(0)
            if how == "overwritten":
                handle.write(b"\x01" * 10**6)
    assert all(same_bits(tensor, state[name]) for name, tensor in loaded.state_dict().items())
    assert same_bits(rows.sensors, sensors)


def test_the_same_content_gives_the_same_bytes(tmp_path: Path) -> None:
    made, shown = bank(), random_pairs(9)
    contents = {made.save(tmp_path / str(number)).read_bytes() for number in range(8)}
    contents.add(bank().save(tmp_path / "again").read_bytes())
    contents.add(BehaviourBank.load(tmp_path / "0").save(tmp_path / "loaded").read_bytes())
    assert len(contents) == 1
    assert len({shown.save(tmp_path / str(number)).read_bytes() for number in range(8)}) == 1


def test_a_bank_over_a_space_with_memory_comes_back(tmp_path: Path) -> None:
    vsa = torchvsa.MAP(128, dtype=torch.int8)
    made = BehaviourBank(Space(SCHEMA, History(encoder(vsa), [1, 3]), protection=torchvsa.SelfShift(vsa)))
    made.learn("seek", random_pairs(9), OneShot())
    again = BehaviourBank.load(made.save(tmp_path / "bank"))
    assert isinstance(again.space.encoder, History)
    assert again.space.same_as(made.space)
    readings = random_pairs(9, seed=1).sensors
    answers = [bank["seek"].step(readings, bank["seek"].start(range(9)))[0] for bank in (made, again)]
    assert same_bits(answers[0].similarity, answers[1].similarity)


FILES = Path(__file__).parent / "files"


def test_files_of_format_2_are_read_by_all_later_versions() -> None:
    """Written once, by 0.2.0; they are never written again."""
    shown = Demonstrations.load(FILES / "demonstrations_format_2.safetensors")
    assert (shown.sensor_names, shown.actuator_names) == (("left", "right"), ("turn",))
    steer = BehaviourBank.load(FILES / "bank_format_2.safetensors")["steer towards. é"]
    recall, _ = steer.step(shown.sensors, steer.start(range(4)))
    assert torch.equal(recall.commands, shown.commands)


def test_tensors_of_any_strides_are_written(tmp_path: Path) -> None:
    tensors = {"one": torch.ones(1, 2, dtype=torch.float16)[:, :1].mT, "turned": torch.arange(6).view(2, 3).mT}
    path = save_tensors(tmp_path / "file", "bank", tensors, {})
    loaded, _ = load_tensors(path, "bank")
    assert torch.equal(loaded["one"], tensors["one"])
    assert torch.equal(loaded["turned"], tensors["turned"])
