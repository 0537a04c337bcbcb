"""What pip installs works outside the checkout."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from commands import only, results

CHECKOUT = Path(__file__).parents[2]
TINY = ("demonstrations=2", "starts=2", "validation_starts=1", "seconds=5", "vsa.dim=300", "workers=1", "animate=false")


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project, built as a wheel and unpacked into a folder of its own, without the packages it depends on."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    # The build works on a copy of the tracked files, so that it leaves nothing in the checkout.
    files = subprocess.run(["git", "ls-files"], cwd=CHECKOUT, capture_output=True, text=True, check=True).stdout
    for name in files.split():
        (folder / "source" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "source" / name).write_bytes((CHECKOUT / name).read_bytes())
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", folder, folder / "source"], check=True)
    wheel = only(folder, "*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", folder / "site", wheel], check=True)
    return folder


def run(installed: Path, *command: str | Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(installed / "site")}
    return subprocess.run(
        [sys.executable, *command], cwd=installed, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_the_wheel_carries_all_configs_and_assets(installed: Path) -> None:
    names = zipfile.ZipFile(only(installed, "*.whl")).namelist()
    for path in (CHECKOUT / "conf").rglob("*.yaml"):
        assert f"experiments/conf/{path.relative_to(CHECKOUT / 'conf').as_posix()}" in names
    for pattern in ("sim/*.urdf", "experiments/*.html"):
        for path in CHECKOUT.glob(pattern):
            assert path.relative_to(CHECKOUT).as_posix() in names
    packages = {name.split("/")[0] for name in names}
    assert {"torchvsa", "behaviours", "sim", "experiments"} <= packages
    assert "tests" not in packages


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
    packages = ("torchvsa", "behaviours", "sim", "experiments")
    code = f"from importlib.util import find_spec; [print(find_spec(name).origin) for name in {packages}]"
    done = run(installed, "-c", code)
    assert done.stdout.split() == [str(installed / "site" / name / "__init__.py") for name in packages]


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
