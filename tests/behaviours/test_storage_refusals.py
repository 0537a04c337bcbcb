"""Files that are damaged, forged or something else are refused, with an error that names the file."""

import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from robots import random_pairs
from safetensors.torch import save_file
from saved import SAVERS, bank, rewritten

from behaviours import BehaviourBank, Demonstrations

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
    with pytest.raises(ValueError, match="foreign holds other tensors, not a torchvsa"):
        load_file(tmp_path / "foreign")
    SAVERS[1 - LOADERS.index(load_file)](tmp_path / "other")
    with pytest.raises(ValueError, match=r"other: description: the file holds '\w+', not '\w+'"):
        load_file(tmp_path / "other")


@pytest.mark.parametrize(("version", "message"), [("1", "written by torchvsa 0.1"), ("9", "holds other tensors")])
def test_files_of_other_versions(version: str, message: str, tmp_path: Path) -> None:
    save_file({"x": torch.ones(3)}, tmp_path / "old", {"kind": "torchvsa.bank", "format": version, "about": "{}"})
    with pytest.raises(ValueError, match=f"old.*{message}"):
        BehaviourBank.load(tmp_path / "old")


CHANGES: dict[str, Callable[[dict[str, Any], dict[str, torch.Tensor]], Any]] = {
    "unknown architecture": lambda about, _: about["space"]["vsa"].update(name="os.system"),
    "unknown type": lambda about, _: about["space"]["vsa"].update(dtype="load"),
    "another size": lambda about, _: about["space"]["vsa"].update(dim=64),
    "unknown protection": lambda about, _: about["space"].update(protection={"name": "builtins.eval"}),
    "unknown option": lambda about, _: about["space"]["protection"].update(command="true"),
    "unknown values": lambda about, _: about["space"]["encoder"]["values"].update(name="exec"),
    "no space": lambda about, _: about.pop("space"),
    "no schema": lambda about, _: about["space"].pop("schema"),
    "space of another kind": lambda about, _: about.update(space=[1]),
    "an unknown encoder": lambda about, _: about["space"]["encoder"].update(name="torch.nn.Linear"),
    "bins that are no number": lambda about, _: about["space"]["encoder"]["values"].update(bins="8"),
    "more bins than codes": lambda about, _: about["space"]["encoder"]["values"].update(bins=10**9),
    "more levels than codes": lambda about, _: about["space"]["schema"]["actuators"][0].update(levels=10**9),
    "more dimensions than codes": lambda about, _: about["space"]["vsa"].update(dim=10**12),
    "a range out of float64": lambda about, _: about["space"]["schema"]["sensors"][0].update(high=10**400),
    "behaviours of another kind": lambda about, _: about.update(behaviours=["avoid"]),
    "a name twice": lambda about, _: about["behaviours"][1].update(name="seek light"),
    "a name that is no text": lambda about, _: about["behaviours"][1].update(name=1),
    "a behaviour left out": lambda about, _: about["behaviours"].pop(),
    "no program": lambda _, tensors: tensors.pop("behaviours.1.program"),
    "an unknown tensor": lambda _, tensors: tensors.update({"behaviours.2.program": torch.ones(128)}),
    "program of another size": lambda _, tensors: tensors.update({"behaviours.1.program": torch.ones(5)}),
    "program of another type": lambda _, tensors: tensors.update({"behaviours.1.program": torch.ones(128).half()}),
    "program of NaN": lambda _, tensors: tensors.update({"behaviours.1.program": torch.full((128,), math.nan)}),
    "known conditions of inf": lambda _, tensors: tensors.update({"behaviours.1.known": torch.full((128,), math.inf)}),
    "results of another robot": lambda _, tensors: tensors.update(
        {"behaviours.1.results": torch.zeros(2, 7, dtype=torch.int64)}
    ),
    "results of another type": lambda _, tensors: tensors.update({"behaviours.1.results": torch.zeros(1, 2)}),
    "a level below all": lambda _, tensors: tensors["behaviours.1.results"][0].fill_(-1),
    "a level above all": lambda _, tensors: tensors["behaviours.1.results"][0].fill_(3),
    "a result twice": lambda _, tensors: tensors["behaviours.1.results"][1].copy_(tensors["behaviours.1.results"][0]),
    "no result": lambda _, tensors: tensors.update({"behaviours.1.results": torch.zeros(0, 2, dtype=torch.int64)}),
    "no codebook": lambda _, tensors: tensors.pop("space.encoder.roles"),
    "codebook of another type": lambda _, tensors: tensors.update(
        {"space.encoder.values.0.codes": tensors["space.encoder.values.0.codes"].float() * 0.9}
    ),
    "codebook of other values": lambda _, tensors: tensors["space.encoder.values.0.codes"].mul_(127),
    "a shift's vector of other values": lambda _, tensors: tensors["space.protect.h"].zero_(),
}


@pytest.mark.parametrize("change", CHANGES)
def test_banks_that_describe_something_else(change: str, tmp_path: Path) -> None:
    path = rewritten(bank().save(tmp_path / "bank"), "bank", CHANGES[change])
    with pytest.raises(ValueError, match=f"{path} does not describe a bank of this version"):
        BehaviourBank.load(path)


CODES: dict[str, tuple[str, Callable[[torch.Tensor], object]]] = {
    "MAP-B": ("encoder.roles", lambda codes: codes[0, 0].fill_(0)),
    "HRR": ("encoder.values.0.codes", lambda codes: codes[0, 0].fill_(math.nan)),
    "FHRR": ("result_encoder.values.0.codes", lambda codes: codes[0, 0].mul_(3)),
}


@pytest.mark.parametrize("vsa", CODES)
def test_codebooks_that_hold_no_codes_of_their_architecture(vsa: str, tmp_path: Path) -> None:
    name, change = CODES[vsa]
    path = rewritten(bank(vsa).save(tmp_path / "bank"), "bank", lambda _, tensors: change(tensors[f"space.{name}"]))
    part, codebook = name.split(".")[0], name.split(".")[-1]
    with pytest.raises(ValueError, match=f"{part}: {codebook} must hold codes of {vsa}"):
        BehaviourBank.load(path)


@pytest.mark.parametrize(
    ("name", "value"), [("sensor", 3), ("sensor", -1), ("threshold", 20), ("threshold", -1)], ids=str
)
def test_thresholds_that_ask_about_what_is_not_there(name: str, value: int, tmp_path: Path) -> None:
    made = bank(combine="threshold_features", subset=2)
    path = rewritten(
        made.save(tmp_path / "bank"),
        "bank",
        lambda _, tensors: tensors[f"space.encoder.{name}"][0, 5].fill_(value),
    )
    with pytest.raises(ValueError, match=f"encoder: {name} must hold numbers in"):
        BehaviourBank.load(path)


def test_what_was_changed_without_its_checksum_is_refused(tmp_path: Path) -> None:
    """One flipped bit of a program is enough."""
    path = bank().save(tmp_path / "bank")
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    with pytest.raises(ValueError, match=f"{path}: the checksum is wrong"):
        BehaviourBank.load(path)


def test_what_cannot_be_loaded_is_not_saved(tmp_path: Path) -> None:
    half = bank("MAP-C", dtype="float32").half()
    with pytest.raises(ValueError, match=r"'space\.encoder\.\w+' is torch\.float16"):
        half.save(tmp_path / "bank")
    broken = bank("HRR")
    broken["avoid"].program[3] = math.nan
    with pytest.raises(ValueError, match="behaviour 'avoid': program holds values that are not finite"):
        broken.save(tmp_path / "bank")
    assert not list(tmp_path.iterdir())


def test_demonstrations_without_their_commands(tmp_path: Path) -> None:
    path = rewritten(
        random_pairs(3).save(tmp_path / "shown"), "demonstrations", lambda _, tensors: tensors.pop("commands")
    )
    with pytest.raises(ValueError, match=f"{path}.*commands"):
        Demonstrations.load(path)
