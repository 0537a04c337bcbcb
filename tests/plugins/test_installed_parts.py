"""A package of parts, installed by pip, is found by name, keeps the laws, and its files need it."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from packages import python

USER = """
import torch
from behaviours import POLICIES, RULES, Actuator, BehaviourBank, Demonstrations, Schema, Sensor, Space
from behaviours.testing import check_policy, check_rule
from torchvsa import MAP, architecture
from torchvsa.encoders import Product, Sum, value_encoder
from torchvsa.testing import check_architecture, check_encoder, check_value_encoder

vsa = architecture("Signed", dim=1000, dtype="int8")
waves = value_encoder({"name": "waves", "length": 0.2}, vsa)
rule, policy = RULES.find("average")(), POLICIES.find("hysteresis")
assert not waves.discrete
schema = Schema([Sensor("left", 0, 5), Sensor("right", 0, 5)], [Actuator("turn", -1, 1, levels=3)])
space = Space(schema, Product(waves, sensors=2), seed=3)

check_architecture(vsa)
check_value_encoder(waves)
check_encoder(Sum(waves, sensors=2))
check_rule(rule, space)
check_policy(policy, space)

readings = 5 * torch.rand(300, 2, generator=torch.Generator().manual_seed(0))
turns = torch.sign((readings[:, :1] - readings[:, 1:]).round())
bank = BehaviourBank(space)
bank.learn("steer", Demonstrations(readings, turns), rule)
bank.learn("halt", Demonstrations(readings[:20], torch.zeros(20, 1)), RULES["one_shot"]())
share = (bank["steer"](readings).commands == turns).double().mean().item()
assert share > 0.8, share
bank.save("bank.safetensors")

other = BehaviourBank(Space(schema, Sum(value_encoder({"name": "waves"}, MAP(500)), sensors=2)))
other.learn("steer", Demonstrations(readings, turns), RULES["one_shot"]())
other.save("waves.safetensors")
"""
ASK = """
import json
import torch
from behaviours import POLICIES, BehaviourBank
bank = BehaviourBank.load("bank.safetensors")
walk = 5 * torch.rand(6, 4, 2, generator=torch.Generator().manual_seed(1))
drives = POLICIES.find("hysteresis")(bank)
state, answers = drives.start(range(4)), []
for readings in walk:
    recall, state = drives.step(readings, state)
    answers.append([recall.commands.tolist(), recall.similarity.tolist(), recall.speaker.tolist()])
print(json.dumps(answers))
"""
SETTINGS = """
from experiments.kit import parts
assert type(parts.rule({"name": "average"})).__module__ == "robot_parts"
"""
WITHOUT = """
from behaviours import BehaviourBank
for file in ("bank", "waves"):
    try:
        BehaviourBank.load(f"{file}.safetensors")
    except ValueError as error:
        print(error)
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package in a folder of its own, as pip installs it."""
    folder = tmp_path_factory.mktemp("robot_parts")
    shutil.copytree(Path(__file__).parent / "robot_parts", folder / "source", ignore=shutil.ignore_patterns("__*"))
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    offline = ["--no-index", "--no-deps", "--no-build-isolation", "--target", folder / "site"]
    done = subprocess.run([*pip, *offline, folder / "source"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "site"


@pytest.mark.slow
def test_an_installed_package_of_parts_works_like_the_librarys_own(site: Path, tmp_path: Path) -> None:
    made = python(site, USER + ASK, "-W", "error", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    loaded = python(site, ASK + SETTINGS, "-W", "error", cwd=tmp_path)
    assert loaded.returncode == 0, loaded.stderr
    answers = json.loads(made.stdout)
    assert json.loads(loaded.stdout) == answers
    assert len({speaker for step in answers for speaker in step[2]}) == 2
    without = python(None, WITHOUT, "-W", "error", cwd=tmp_path)
    assert without.returncode == 0, without.stderr
    bank, waves = without.stdout.splitlines()
    assert re.match(r"bank\.safetensors .*there is no architecture 'Signed'; choose one of MAP-C, .*", bank)
    assert re.match(r"waves\.safetensors .*there is no value encoder 'waves'; choose one of lookup, .*", waves)


@pytest.mark.slow
def test_its_study_and_arena_are_commands_and_options_like_the_others(site: Path, tmp_path: Path) -> None:
    torchvsa = "from experiments.main import main; main({!r})"
    study = ["gaps", "starts=3", "seconds=10", "workers=2"]
    calls = f"{torchvsa.format([])}; print('---'); main(['corral', '--help']); main({study})"
    ran = python(site, calls, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    commands, options = ran.stdout.split("---\n", 1)
    assert re.search(r"gaps +How wide must the gap be\?", commands)
    for part in ("signed", "average", "hysteresis", "hall"):
        assert part in options
    (results,) = tmp_path.rglob("results.json")
    assert [row["gap"] for row in json.loads(results.read_text())["table"]] == [0.8, 1.4]
