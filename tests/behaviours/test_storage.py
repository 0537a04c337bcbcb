"""Files hold every bit, are written whole or not at all, and run nothing when they are read."""

import copy
import math
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from robots import SCHEMA, encoder, random_pairs, same_bits, space
from safetensors.torch import load, save_file

import torchvsa
from behaviours import BehaviourBank, Demonstrations, ErrorDriven, OneShot, Space
from behaviours.learning import no_convergence_warnings
from behaviours.storage import load_tensors, save_tensors
from torchvsa import ARCHITECTURES
from torchvsa.encoders import History


def real(tensor: torch.Tensor) -> torch.Tensor:
    return torch.view_as_real(tensor) if tensor.is_complex() else tensor


def bank(vsa: str = "MAP-C", protection: Any = "self_shift", dtype: str | None = None, **encoder: Any) -> BehaviourBank:
    made = BehaviourBank(space(128, vsa, dtype, protection, seed=3, **encoder))
    made.learn("seek light", random_pairs(9), OneShot("similarity", clip_each_step=True))
    with no_convergence_warnings():
        made.learn("avoid", random_pairs(30, seed=1), ErrorDriven(epochs=2))
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


def rewritten(path: Path, kind: str, change: Callable[[dict[str, Any], dict[str, torch.Tensor]], Any]) -> Path:
    """The file with another description or other tensors, and a checksum that fits."""
    tensors, about = load_tensors(path, kind)
    change(about, tensors)
    return save_tensors(path, kind, tensors, about)


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
    with pytest.raises(ValueError, match=f"{path}: the checksum does not fit"):
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


NAMES = ["forward", "train", "to", "keys", "pop", "a.b", "a/b", " ", "\n", "\x00", "\ud800", "é\u202e", "x" * 1000]


def test_any_text_names_a_behaviour(tmp_path: Path) -> None:
    names = list(dict.fromkeys([*dir(torch.nn.ModuleDict()), *dir(BehaviourBank), *NAMES]))
    made = BehaviourBank(space(32))
    behaviour = OneShot().fit(made.space, random_pairs(3))
    for name in names:
        made.add(name, behaviour)
    assert made.names == names
    again = BehaviourBank.load(made.save(tmp_path / "bank"))
    assert again.names == names
    assert all(same_bits(again[name].program, behaviour.program) for name in again)


@pytest.mark.parametrize("name", ["", 5, None, ("a",), True])
def test_what_cannot_name_a_behaviour_is_refused_before_it_is_learned(name: Any) -> None:
    class Unasked(OneShot):
        def fit(self, *_: Any, **__: Any) -> Any:
            raise AssertionError("it was learned first")

    with pytest.raises(ValueError, match="name is a text that is not empty"):
        BehaviourBank(space(32)).learn(name, random_pairs(3), Unasked())


@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))], ids=["copied", "pickled"]
)
def test_copies_of_a_behaviour_can_join_its_bank_again(duplicate: Callable[[Any], Any]) -> None:
    made = bank()
    twin = duplicate(made["avoid"])
    twin.program.neg_()
    made.add("flee", twin)
    assert made["flee"].space is made.space
    assert same_bits(made["flee"].program, -made["avoid"].program)
    made.add("tuned", duplicate(made["avoid"].trainable()))
    assert isinstance(made["tuned"].program, torch.nn.Parameter)
    for other in (bank(protection="none"), BehaviourBank(space(128, seed=4))):
        with pytest.raises(ValueError, match="learned over another space"):
            other.add("avoid", made["avoid"])
    changed = duplicate(made)
    changed.space.encoder.codes[0].neg_()
    with pytest.raises(ValueError, match="learned over another space"):
        made.add("avoid", changed["avoid"])


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
