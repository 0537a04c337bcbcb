"""The extra `data` is enough for every format, and no format is needed to import the package."""

import tomllib
from pathlib import Path

from packages import ROOT, python

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

REFUSE_ALL = f"""
{BLOCK.format(names=FORMATS)}
import behaviours, behaviours.data
for call in ("read_csv('a.csv')", "read_minari('a-v0')", "read_mcap('a.mcap')"):
    try:
        open(call[call.index("'") + 1 : -2], "w").write("a\\n1\\n")
        eval("behaviours.data." + call)
    except ImportError as error:
        print(error)
"""


def test_every_format_is_read_with_the_extra_alone(tmp_path: Path) -> None:
    run = python(None, READ_ALL, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-1] == "[12, 4, 6, 12, 12, 1]"


def test_without_the_extra_an_error_says_what_to_install(tmp_path: Path) -> None:
    run = python(None, REFUSE_ALL, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert len(lines) == 3
    assert all("pip install 'torchvsa[data]'" in line for line in lines)


def test_the_extra_names_every_library_of_a_format() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    named = {requirement.partition(">")[0].lower().replace("-", "_") for requirement in extras["data"]}
    called = {"PIL": "pillow", "mcap_ros2": "mcap_ros2_support", "yaml": "pyyaml"}
    assert {called.get(name, name) for name in FORMATS} == named
    assert all(">=" in requirement for requirement in extras["data"])
    assert any("data" in requirement for requirement in extras["dev"] if requirement.startswith("torchvsa["))
