"""Bad input gets one clear line that names what is wrong, a non-zero exit, and no half-written result."""

from pathlib import Path
from subprocess import CompletedProcess

import pytest
import torch
from commands import SMALL, corral

from behaviours.storage import save_tensors


def assert_refused(run: CompletedProcess[str], words: str, folder: Path) -> None:
    assert run.returncode == 1
    (line,) = run.stderr.splitlines()
    assert words in line
    assert "Traceback" not in run.stdout
    for unfinished in ("results.json", "report.html", "records.parquet", "behaviours.safetensors"):
        assert not list(folder.rglob(unfinished))


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("experiment=nonsense", "nonsense"),
        ("rule=nonsense", "nonsense"),
        ("controllers=[teacher,nobody]", "'nobody'"),
        ("vsa.name=MAP-X", "'MAP-X'"),
        ("vsa.dim=0", "dim"),
        ("vsa.dim=8", "no weights of the five rules"),
        ("encoder.bins=0", "bins"),
        ("encoder.nonsense=3", "nonsense"),
        ("arena.preset=nowhere", "'nowhere'"),
        ("body.name=legged", "legged"),
        ("demonstrations=0", "episode"),
        ("seconds=-1", "-1"),
        ("seed=-1", "-1"),
        ("workers=0", "workers"),
        ("rule.margin=-1", "margin"),
        ("hydra.run.dir=/dev/null/results", "/dev/null"),
    ],
)
def test_one_line_names_what_is_wrong(tmp_path: Path, override: str, words: str) -> None:
    run = corral(tmp_path, *SMALL, override)
    assert_refused(run, words, tmp_path)


def test_the_traceback_is_there_for_those_who_ask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    run = corral(tmp_path, *SMALL, "controllers=[nobody]")
    assert run.returncode == 1
    assert "Traceback" in run.stderr


READINGS = torch.tensor([[5.0, 5.0, 0.5], [1.0, 1.0, 0.5]], dtype=torch.float64)


@pytest.mark.parametrize(
    ("readings", "words"),
    [
        (READINGS[:, :2], "sensor readings must be rows of 3 values (light_left, light_right, distance)"),
        (READINGS + 1, "sensor 'light_left' reads 6 in row 0; its range is [0, 5] m"),
        (READINGS * torch.inf, "infinite value in row 0, column 0"),
        (READINGS[:0], "needs at least one row"),
        (torch.full_like(READINGS, torch.nan), "row 0 of the demonstrations has no observed sensor"),
    ],
)
def test_a_file_of_demonstrations_that_does_not_fit(tmp_path: Path, readings: torch.Tensor, words: str) -> None:
    shown = tmp_path / "shown.safetensors"
    tensors = {"sensors": readings, "commands": torch.ones(len(readings), 2, dtype=torch.float64)}
    save_tensors(shown, "demonstrations", tensors | {"episodes": torch.zeros(len(readings), dtype=torch.int64)}, {})
    assert_refused(corral(tmp_path, *SMALL, f"demonstrations_file={shown}", "controllers=[default]"), words, tmp_path)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    assert_refused(corral(tmp_path, "demonstrations_file=nowhere.safetensors"), "nowhere.safetensors", tmp_path)
