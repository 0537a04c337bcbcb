"""Bad input gets one clear line that names what is wrong, a non-zero exit, and no half-written result."""

from pathlib import Path

import pytest
from commands import SMALL, corral


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("experiment=nonsense", "nonsense"),
        ("rule=nonsense", "nonsense"),
        ("controllers=[teacher,nobody]", "'nobody'"),
        ("vsa.name=MAP-X", "'MAP-X'"),
        ("vsa.dim=0", "dim"),
        ("encoder.bins=0", "level"),
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
    assert run.returncode == 1
    lines = [line for line in run.stderr.splitlines() if "pybullet build time" not in line]
    assert len(lines) == 1, run.stderr
    assert words in lines[0]
    assert "Traceback" not in run.stdout
    assert not list(tmp_path.rglob("results.json"))
    assert not list(tmp_path.rglob("report.html"))


def test_the_traceback_is_there_for_those_who_ask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    run = corral(tmp_path, *SMALL, "controllers=[nobody]")
    assert run.returncode == 1
    assert "Traceback" in run.stderr
