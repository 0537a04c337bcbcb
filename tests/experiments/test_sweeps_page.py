"""The code of the pages on launchers runs: a Dask cluster, and a search with Optuna that goes on."""

import re
from pathlib import Path

import pytest
from packages import ROOT, python
from test_docs import TINY

pytest.importorskip("optuna", reason="needs the extra cluster")


def code_of(page: str) -> str:
    (found,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "launchers" / f"{page}.md").read_text(), re.DOTALL)
    return found


@pytest.mark.slow
def test_cells_on_a_dask_cluster(tmp_path: Path) -> None:
    ran = python(None, code_of("dask"), cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert ".accuracy" in ran.stdout
    assert list(tmp_path.rglob("results.json"))


@pytest.mark.slow
def test_a_search_with_optuna_goes_on(tmp_path: Path) -> None:
    code = code_of("optuna")
    assert len([line for line in code.splitlines() if line]) <= 20
    tiny = "".join(f', "{setting}"' for setting in TINY)
    code = code.replace('"controllers=[teacher,default]"', f'"controllers=[teacher,default]"{tiny}')
    first, again = (code.replace("20 -", f"{trials} -") for trials in (2, 3))
    ran = python(None, first + again, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "Trial 2 finished" in ran.stderr
    assert "Trial 3" not in ran.stderr
    assert re.search(r"^\{'dim': \d+, 'epochs': \d+\} [\d.]+$", ran.stdout, re.MULTILINE)
    assert 1 < len(list((tmp_path / "outputs" / "corral" / "sweep").rglob("results.json"))) < 4
