"""What pip installs works outside the checkout."""

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from commands import results
from distributions import build, tracked

PACKAGES = ("torchvsa", "behaviours", "sim", "experiments")
TINY = ("demonstrations=2", "starts=2", "validation_starts=1", "seconds=5", "vsa.dim=300", "workers=1", "animate=false")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The wheel, and the source distribution that it was built from."""
    return build(tmp_path_factory.mktemp("distributions"))


@pytest.fixture(scope="module")
def installed(built: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder whose subfolder `site` holds the installed wheel, without the packages it depends on."""
    folder = tmp_path_factory.mktemp("installed")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "install", "--no-deps", "--target", folder / "site", built[0]], check=True)
    return folder


def run(installed: Path, *command: str | Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(installed / "site")}
    return subprocess.run(
        [sys.executable, *command], cwd=installed, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_the_wheel_holds_every_file_of_the_four_packages_and_nothing_else(built: tuple[Path, Path]) -> None:
    names = {name for name in zipfile.ZipFile(built[0]).namelist() if ".dist-info/" not in name}
    assert names == {name for name in tracked() if name.split("/")[0] in PACKAGES}
    assert {"sim/engines/robot.urdf", "experiments/kit/page.html"} <= names
    assert any(name.startswith("behaviours/data/wall_following/") for name in names)


@pytest.mark.slow
def test_the_source_distribution_holds_what_the_tests_need(built: tuple[Path, Path]) -> None:
    with tarfile.open(built[1]) as archive:
        names = {member.name.split("/", 1)[1] for member in archive if member.isfile()}
    assert {name for name in tracked() if not name.startswith(".")} <= names
    more = {name for name in names - {*tracked()} if ".egg-info/" not in name}
    assert more == {"PKG-INFO", "setup.cfg"}


@pytest.mark.slow
def test_an_index_would_take_both(built: tuple[Path, Path]) -> None:
    command = [sys.executable, "-m", "twine", "check", "--strict", *built]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_console_command_takes_the_users_own_configs(installed: Path) -> None:
    (installed / "mine" / "experiment").mkdir(parents=True)
    (installed / "mine" / "experiment" / "tiny.yaml").write_text(
        "# @package _global_\ncontrollers: [default]\nencoder: {bins: 16}\n"
    )
    command = installed / "site" / "bin" / "torchvsa-corral"
    done = run(installed, command, "--config-dir", "mine", "experiment=tiny", *TINY)
    assert done.returncode == 0, done.stderr
    content = results(installed / "outputs")
    assert content["config"]["encoder"]["bins"] == content["table"][0]["bins"] == 16


@pytest.mark.slow
def test_it_is_the_installed_code_that_ran(installed: Path) -> None:
    code = f"from importlib.util import find_spec; [print(find_spec(name).origin) for name in {PACKAGES}]"
    done = run(installed, "-c", code)
    assert done.stdout.split() == [str(installed / "site" / name / "__init__.py") for name in PACKAGES]


@pytest.mark.slow
def test_the_library_works_without_the_extra(installed: Path) -> None:
    hide = "import sys; sys.modules['hydra'] = sys.modules['pybullet'] = None; "
    assert run(installed, "-c", f"{hide}import torchvsa, behaviours").returncode == 0


@pytest.mark.slow
def test_without_the_extra_the_studies_say_what_to_install(installed: Path) -> None:
    done = run(installed, "-c", "import sys; sys.modules['hydra'] = None; import experiments")
    assert done.returncode == 1
    assert done.stderr.strip().splitlines()[-1].endswith("pip install 'torchvsa[corral]'")


@pytest.mark.slow
def test_studies_in_the_vector_engine_need_no_pybullet(installed: Path) -> None:
    hide = "import sys; sys.modules['pybullet'] = None; "
    done = run(installed, "-c", f"{hide}from experiments.main import main; main(['capacity', '--help'])")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_rows_that_need_pybullet_are_refused_before_anything_is_driven(installed: Path) -> None:
    hide = "import sys; sys.modules['pybullet'] = None; "
    done = run(installed, "-c", f"{hide}from experiments.main import main; main(['corral'])")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    rows = "teacher_bullet, default_bullet, teacher_wheeled"
    assert line.startswith(f"corral: controllers: {rows} cannot drive: engine=bullet needs pybullet")
    assert not (installed / "outputs" / "corral" / "default").exists()


@pytest.mark.slow
def test_a_file_with_the_name_of_a_package_is_said_in_one_line(installed: Path) -> None:
    mine = installed / "mine" / "sim.py"
    mine.parent.mkdir(exist_ok=True)
    mine.write_text("")
    code = f"import sys; sys.path.insert(0, {str(mine.parent)!r}); sys.argv[0] = 'torchvsa'; import experiments"
    done = run(installed, "-c", code)
    assert done.returncode == 1
    ours = installed / "site" / "sim" / "__init__.py"
    assert done.stderr == f"torchvsa: `import sim` finds {mine} instead of {ours}; rename or remove it\n"


@pytest.mark.slow
def test_another_distribution_that_replaced_a_package_is_said_in_one_line(
    built: tuple[Path, Path], tmp_path: Path
) -> None:
    site = tmp_path / "site"
    zipfile.ZipFile(built[0]).extractall(site)
    other = site / "sim_card-2.0.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: sim-card\nVersion: 2.0\n")
    (other / "RECORD").write_text("sim/__init__.py,,\n")
    command = "import sys; sys.argv[0] = 'torchvsa'; from experiments.main import main; main(['--version'])"
    told = run(tmp_path, "-c", command)
    assert told.returncode == 0
    version, line = told.stdout.splitlines()
    assert version.startswith("torchvsa ")
    assert line.startswith("sim-card installs a package sim too, as torchvsa does: ")

    (site / "sim" / "__init__.py").write_text("# of another package\n")
    done = run(tmp_path, "-c", command)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"torchvsa: sim-card has overwritten {site / 'sim' / '__init__.py'} of torchvsa; ")
