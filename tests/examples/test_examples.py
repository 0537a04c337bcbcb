"""The examples run as their first lines say."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from behaviours import Actuator, BehaviourBank, Demonstrations, Schema, Sensor, Space

EXAMPLES = Path(__file__).parents[2] / "examples"
STANDIN = Path(__file__).parent / "standin"


def output_of(folder: Path, script: str, *arguments: str, path: Path | None = None) -> str:
    places = [str(Path(__file__).parents[2]), *([] if path is None else [str(path)])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(places), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(EXAMPLES / script), *arguments]
    run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_every_example_says_how_to_run_it_and_has_a_test() -> None:
    tested = Path(__file__).read_text()
    for script in EXAMPLES.glob("*.py"):
        assert f"python examples/{script.name}" in script.read_text(), script
        assert f'"{script.name}"' in tested, script


@pytest.mark.slow
def test_the_control_loop_keeps_its_rate(tmp_path: Path) -> None:
    printed = output_of(tmp_path, "control_loop.py", "--seconds", "0.4")
    found = re.search(r"20 steps, \d+ late; an answer takes (\d+) µs; (\d+) MB", printed)
    assert found, printed
    assert int(found[2]) < 1000
    assert list(BehaviourBank.load(tmp_path / "escape.safetensors")) == ["escape"]


@pytest.mark.slow
def test_a_csv_log_becomes_a_behaviour(tmp_path: Path) -> None:
    printed = output_of(tmp_path, "csv_log.py")
    errors = re.findall(r"(\w+): mean error ([\d.]+); of the mean command ([\d.]+)", printed)
    assert [name for name, *_ in errors] == ["left_motor", "right_motor"]
    assert all(float(mine) < float(mean) / 3 for _, mine, mean in errors)
    assert "distance: sensor, real; its range is" in printed
    bank = BehaviourBank.load(tmp_path / "drive.safetensors")
    assert bank["drive"].smooth
    assert [sensor.unit for sensor in bank.space.schema.sensors] == ["m", "m", "m"]
    # The same log, read again.
    assert "drive.safetensors is written" in output_of(tmp_path, "csv_log.py", "corral.csv")


@pytest.mark.slow
def test_a_clone_of_five_episodes_balances_the_pole(tmp_path: Path) -> None:
    printed = output_of(tmp_path, "clone_cartpole.py")
    returns = [float(one) for one in re.findall(r"[\d.]+", printed.split("returns [")[1].split("]")[0])]
    assert "2500 steps shown; program of 4,000 numbers" in printed
    assert min(returns) > 200


@pytest.mark.slow
def test_what_a_lerobot_arm_showed_is_learned(tmp_path: Path) -> None:
    printed = output_of(tmp_path, "lerobot.py")
    assert "Log(2000 rows" in printed
    assert "episode_index: left out, it names the episodes" in printed
    errors = re.findall(r"action\.(\w+): mean error ([\d.]+); of the mean command ([\d.]+)", printed)
    assert [joint for joint, _, _ in errors] == ["shoulder", "elbow"]
    assert all(float(error) < 0.5 * float(mean) for _, error, mean in errors)


@pytest.mark.slow
def test_the_ros_node_publishes_what_the_behaviour_commands_and_stops_when_blind(tmp_path: Path) -> None:
    schema = Schema(
        [Sensor("near", 0, 1, "m", "clip"), Sensor("far", 0, 1, "m", "clip")],
        [Actuator("left_motor", -1, 1, levels=3), Actuator("right_motor", -1, 1, levels=3)],
    )
    bank = BehaviourBank(Space(schema))
    shown = [[0.1 * turn, 0.1 * (turn + 1)] for turn in range(5)]
    wheels = [[1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]
    bank.learn("drive", Demonstrations(shown, wheels))
    bank.save(tmp_path / "bank.safetensors")
    printed = output_of(tmp_path, "ros2_node.py", "bank.safetensors", "drive", "/near", "/far", path=STANDIN)
    twists = [tuple(map(float, line.split())) for line in printed.splitlines()]
    expected = [(0.2 * (left + right), 2.0 * (right - left)) for left, right in wheels]
    assert np.allclose(twists, [*expected, (0.0, 0.0)])
