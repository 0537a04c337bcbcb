"""The extra `data` is enough for every format; without a library an error says what to install."""

import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import test_lerobot
import test_mcap
from packages import ROOT, python

from behaviours.data import read_csv, read_lerobot, read_mcap, read_minari

FOLDER = Path(__file__).parent
BLOCKED = ["pandas", "sklearn", "scipy", "hydra", "omegaconf", "matplotlib", "seaborn", "joblib", "pybullet"]
FORMATS = ["pyarrow", "gymnasium", "minari", "h5py", "PIL", "mcap", "mcap_ros2", "yaml"]

BLOCK = """
import sys
class Blocker:
    def find_spec(self, name, *_):
        if name.partition(".")[0] in {names}:
            raise ModuleNotFoundError(f"no module {{name}}", name=name)
sys.meta_path.insert(0, Blocker())
"""
READ_ALL = f"""
{BLOCK.format(names=[*BLOCKED, "experiments", "sim"])}
import os, pathlib
sys.path.insert(0, {str(FOLDER)!r})
os.environ["MINARI_DATASETS_PATH"] = os.getcwd()
import test_gymnasium, test_lerobot, test_mcap, test_minari
from behaviours.data import read, read_minari, write_minari
here = pathlib.Path.cwd()
logs = [
    read(test_lerobot.dataset(here / "arm", "v3.0")),
    read(test_mcap.write(here / "run.mcap")),
    test_gymnasium.recorded()[0],
]
for form in ("hdf5", "arrow"):
    write_minari(test_minari.demonstrations(), test_minari.SCHEMA, form + "-v0", data_format=form)
    logs.append(read(here / (form + "-v0")))
(here / "log.csv").write_text("front [m],v\\n1,2\\n")
logs.append(read(here / "log.csv"))
print([len(log) for log in logs])
"""


def test_every_format_is_read_with_the_extra_alone(tmp_path: Path) -> None:
    run = python(None, READ_ALL, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-1] == "[12, 4, 6, 12, 12, 1]"


@pytest.mark.parametrize(
    ("module", "call", "package"),
    [
        ("pyarrow.csv", lambda path: read_csv(path), "pyarrow"),
        ("pyarrow.parquet", lambda path: read_lerobot(path), "pyarrow"),
        ("minari", lambda path: read_minari(path), "minari"),
        ("mcap.reader", lambda path: read_mcap(path), "mcap"),
        ("mcap_ros2.decoder", lambda path: read_mcap(path), "mcap-ros2-support"),
    ],
)
def test_without_the_extra_an_error_says_what_to_install(
    module: str, call: Callable[[Path], Any], package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    test_lerobot.dataset(tmp_path / "arm", "v3.0")
    test_mcap.write(tmp_path / "run.mcap")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=rf"needs {package}: pip install 'torchvsa\[data\]'"):
        call(tmp_path / {"pyarrow.parquet": "arm", "minari": "wall-v0"}.get(module, "run.mcap"))


def test_the_extra_names_every_library_of_a_format() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    named = {requirement.partition(">")[0].lower().replace("-", "_") for requirement in extras["data"]}
    called = {"PIL": "pillow", "mcap_ros2": "mcap_ros2_support", "yaml": "pyyaml"}
    assert {called.get(name, name) for name in FORMATS} == named
    assert all(">=" in requirement for requirement in extras["data"])
    assert any("data" in requirement for requirement in extras["dev"] if requirement.startswith("torchvsa["))
