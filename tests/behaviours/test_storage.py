"""Files hold every bit, are written whole or not at all, and run nothing when they are read."""

import json
import math
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from robots import random_pairs, same_bits, space
from safetensors import safe_open
from safetensors.torch import load, save_file

from behaviours import BehaviourBank, Demonstrations, ErrorDriven, OneShot
from behaviours import storage as module
from behaviours.learning import no_convergence_warnings
from torchvsa import ARCHITECTURES


def real(tensor: torch.Tensor) -> torch.Tensor:
    return torch.view_as_real(tensor) if tensor.is_complex() else tensor


def bank(vsa: str = "MAP-C", protection: Any = "self_shift", **encoder: Any) -> BehaviourBank:
    made = BehaviourBank(space(128, vsa, protection=protection, seed=3, **encoder))
    made.learn("seek light", random_pairs(9), OneShot("similarity", clip_each_step=True))
    with no_convergence_warnings():
        made.learn("avoid", random_pairs(30, seed=1), ErrorDriven(passes=2))
    return made


@pytest.mark.parametrize("vsa", ARCHITECTURES)
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
    made.space.conditions.table.neg_()
    loaded = BehaviourBank.load(made.save(tmp_path / "bank")).space.conditions.table
    assert same_bits(loaded, made.space.conditions.table)


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


SAVERS: list[Callable[[Path], Path]] = [
    lambda path: bank().save(path),
    lambda path: random_pairs(3).save(path),
]


@pytest.mark.parametrize("save", SAVERS, ids=["bank", "demonstrations"])
@pytest.mark.parametrize("step", ["fsync", "replace", "fdopen"])
def test_a_write_that_fails_leaves_the_old_file(
    save: Callable[[Path], Path], step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "kept"
    path.write_bytes(b"what was there before")

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module.os, step, fail)
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


LOADERS = [BehaviourBank.load, Demonstrations.load]


@pytest.mark.parametrize("load_file", LOADERS, ids=["bank", "demonstrations"])
def test_files_that_are_something_else(load_file: Callable[[Path], object], tmp_path: Path) -> None:
    missing = tmp_path / "missing"
    with pytest.raises(FileNotFoundError, match=f"there is no file {missing}"):
        load_file(missing)
    whole = SAVERS[LOADERS.index(load_file)](tmp_path / "whole").read_bytes()
    for number, content in enumerate((b"", b"not a tensor", pickle.dumps([1]), whole[: len(whole) // 2])):
        path = tmp_path / f"corrupt{number}"
        path.write_bytes(content)
        with pytest.raises(ValueError, match=f"{path} is not a readable torchvsa"):
            load_file(path)
    save_file({"x": torch.ones(3)}, tmp_path / "foreign")
    with pytest.raises(ValueError, match="foreign holds other tensors, not torchvsa"):
        load_file(tmp_path / "foreign")
    SAVERS[1 - LOADERS.index(load_file)](tmp_path / "other")
    with pytest.raises(ValueError, match=r"other holds torchvsa\.\w+, not torchvsa"):
        load_file(tmp_path / "other")


def rewritten(path: Path, change: Callable[[dict[str, Any], dict[str, torch.Tensor]], Any]) -> Path:
    """The file with another description or other tensors."""
    with safe_open(path, framework="pt") as file:
        about = json.loads(file.metadata()["about"])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a mapping)
        metadata = file.metadata()
    change(about, tensors)
    save_file(tensors, path, metadata | {"about": json.dumps(about)})
    return path


CHANGES: dict[str, Callable[[dict[str, Any], dict[str, torch.Tensor]], Any]] = {
    "unknown architecture": lambda about, _: about["space"]["vsa"].update(name="os.system"),
    "unknown type": lambda about, _: about["space"]["vsa"].update(dtype="load"),
    "another size": lambda about, _: about["space"]["vsa"].update(dim=64),
    "unknown protection": lambda about, _: about["space"].update(protection={"name": "builtins.eval"}),
    "unknown option": lambda about, _: about["space"]["protection"].update(command="true"),
    "unknown values": lambda about, _: about["space"]["encoder"].update(values="exec"),
    "no space": lambda about, _: about.pop("space"),
    "no schema": lambda about, _: about["space"].pop("schema"),
    "space of another kind": lambda about, _: about.update(space=[1]),
    "behaviours of another kind": lambda about, _: about.update(behaviours=["avoid"]),
    "no program": lambda _, tensors: tensors.pop("behaviours.avoid.program"),
    "program of another size": lambda _, tensors: tensors.update({"behaviours.avoid.program": torch.ones(5)}),
    "results of another robot": lambda _, tensors: tensors.update(
        {"behaviours.avoid.results": torch.zeros(2, 7, dtype=torch.int64)}
    ),
    "no codebook": lambda _, tensors: tensors.pop("space.conditions.table"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_banks_that_describe_something_else(change: str, tmp_path: Path) -> None:
    path = rewritten(bank().save(tmp_path / "bank"), CHANGES[change])
    with pytest.raises(ValueError, match=f"{path} does not describe a bank of this version"):
        BehaviourBank.load(path)


def test_demonstrations_without_their_commands(tmp_path: Path) -> None:
    path = rewritten(random_pairs(3).save(tmp_path / "shown"), lambda _, tensors: tensors.pop("commands"))
    with pytest.raises(ValueError, match=f"{path}.*commands"):
        Demonstrations.load(path)
