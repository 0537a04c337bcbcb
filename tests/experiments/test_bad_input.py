"""Bad input gets one clear line that names what is wrong, a non-zero exit, and no half-written result."""

from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from behaviours.storage import save_tensors
from experiments.main import main

Refused = Callable[..., str]


@pytest.fixture
def refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Refused:
    """What the command says to overrides that it refuses: one line, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")  # which the command changes
    monkeypatch.setattr("sys.argv", ["torchvsa"])

    def call(*overrides: str) -> str:
        with pytest.raises(SystemExit) as exit_:
            main(["corral", *overrides])
        assert exit_.value.code == 1
        printed = capsys.readouterr()
        (line,) = printed.err.splitlines()
        assert "Traceback" not in printed.out
        for unfinished in ("results.json", "report.html", "cells.jsonl", "*.parquet", "behaviours.safetensors"):
            assert not list(tmp_path.rglob(unfinished))
        return line

    return call


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ("experiment=nonsense", "nonsense"),
        ("rule=nonsense", "nonsense"),
        ("arena=nowhere", "nowhere"),
        ("controllers=[teacher,nobody]", "controllers: there is no 'nobody'; choose from teacher, default"),
        ("controllers=[random,random]", "controllers names 'random' 2 times"),
        ("controllers=[]", "controllers is empty; choose from teacher, default"),
        ("vsa.name=MAP-X", "'MAP-X'"),
        ("vsa.dim=0", "vsa.dim=0: dim is the number of elements of a hypervector, a positive integer"),
        ("vsa.dtype=float16", "vsa: MAP holds float32, float64 or int8 codes"),
        ("rule.epochs=0", "rule.epochs=0: epochs is a whole number of at least 1"),
        ("rule@paper.rule=error_driven paper.rule.epochs=0", "paper.rule.epochs=0: epochs"),
        ("vsa=3", "vsa=3: expected an option of vsa: map_c, map_b"),
        ("rule=", "rule=: expected an option of rule: one_shot, error_driven"),
        ("rule=null", "rule=null: expected an option of rule"),
        ("paper=3", "paper=3: it holds settings; write paper.setting=value"),
        ("paper.protection=3", "paper.protection=3: to choose an option, write protection@paper.protection=3"),
        ("engine=[]", "engine=[]: expected a text"),
        ("~seed", "~seed: no setting can be left out; write seed=value"),
        ("--hlep", "--hlep: there is no such flag; choose from --help"),
        ("--experimental-rerun=job.pickle", "there is no such flag"),
        ("seed", "seed: write setting=value"),
        ("vsa.dim=8", "no weights of the 5 rules"),
        ("vsa=hrr rule=least_squares", "the rule least_squares cannot train programs of HRR"),
        ("vsa=hrr rule@paper.rule=least_squares", "the rule least_squares cannot train programs of HRR"),
        ("paper.rule=least_squares", "paper.rule=least_squares: to choose an option, write rule@paper.rule="),
        ("composition.weights={nobody:2}", "nobody"),
        ("encoder.bins=0", "bins"),
        ("encoder.nonsense=3", "nonsense"),
        ("arena.gap=9", "gap"),
        ("body=legged", "body: there is no 'legged'; choose from planar, wheeled"),
        ("demonstrations=0", "demonstrations=0: expected a number from 1 to 1000000"),
        ("starts=1000000000", "starts=1000000000: expected a number from 1 to 1000000"),
        ("paper_bins=[0]", "paper_bins=[0]: expected 1 or more"),
        ("seconds=0.01", "seconds=0.01: expected 0.05 or more"),
        ("seconds=inf", "seconds=inf: expected a finite number, 0.05 or more"),
        ("body=wheeled", "body=wheeled: engine=vector does not have it; choose engine=bullet"),
        ("seed=-1", "seed=-1: expected 0 or more"),
        ("seed=99999999999999999999", "expected at most 2147483647"),
        ("workers=0", "workers=0: expected a number from 1 to 1000"),
        ("rule.margin=-1", "margin"),
        ("demonstrations_file=nowhere.safetensors", "nowhere.safetensors"),
        ("hydra.run.dir=/dev/null/results", "/dev/null"),
    ],
)
def test_one_line_names_what_is_wrong(refused: Refused, overrides: str, words: str) -> None:
    assert words in refused(*overrides.split())


READINGS = torch.tensor([[5.0, 5.0, 0.5], [1.0, 1.0, 0.5]], dtype=torch.float64)


@pytest.mark.parametrize(
    ("readings", "words"),
    [
        (READINGS[:, :2], "sensor readings must be rows of 3 values (light_left, light_right, distance)"),
        (READINGS + 1, "sensor 'light_left' reads 6 in row 0; its range is [0, 5] m"),
        (READINGS * torch.inf, "infinite value in row 0, column 0"),
        (READINGS[:0], "needs at least one row"),
    ],
)
def test_a_file_of_demonstrations_that_does_not_fit(
    refused: Refused, tmp_path: Path, readings: torch.Tensor, words: str
) -> None:
    tensors = {"sensors": readings, "commands": torch.ones(len(readings), 2, dtype=torch.float64)}
    tensors["episodes"] = torch.zeros(len(readings), dtype=torch.int64)
    save_tensors(tmp_path / "shown.safetensors", "demonstrations", tensors, {})
    assert words in refused("demonstrations_file=shown.safetensors", "controllers=[default]")


def test_a_file_without_any_observed_sensor(refused: Refused, tmp_path: Path) -> None:
    tensors = {"sensors": torch.full_like(READINGS, torch.nan), "commands": torch.ones(2, 2, dtype=torch.float64)}
    save_tensors(tmp_path / "shown.safetensors", "demonstrations", tensors | {"episodes": torch.zeros(2).long()}, {})
    words = "row 0 of the demonstrations has no observed sensor"
    assert words in refused("demonstrations_file=shown.safetensors", "controllers=[default]", "starts=1", "workers=1")
