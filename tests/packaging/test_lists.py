"""The lists of packages are true: versions, hashes, licences, extras and Pythons."""

import re
import tomllib
from importlib import metadata

import hashes
import licences
import pytest
import release_check
from packages import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
INSTALL = (ROOT / "docs" / "install.md").read_text()


def test_every_tested_version_has_the_hash_of_a_file() -> None:
    lines = [line for line in (ROOT / "requirements-hashed.txt").read_text().splitlines() if not line.startswith("#")]
    assert all(re.fullmatch(r"\S+==\S+ --hash=sha256:[0-9a-f]{64}", line) for line in lines)
    assert [line.split()[0] for line in lines] == hashes.pins(), "make hashes"


def test_what_the_tests_install_is_pinned() -> None:
    versions = dict(pin.split("==") for pin in hashes.pins())
    pinned = {hashes.plain(name): version for name, version in versions.items()}
    for package in licences.packages():
        if {"all", "dev"} & {*package.extras}:
            assert pinned.get(hashes.plain(package.name)) == package.version, package.name


def test_the_page_of_licences_is_what_the_packages_say() -> None:
    page = licences.PAGE.read_text()
    assert page.startswith(licences.TITLE)
    for package in licences.packages():
        assert package.row() in page.splitlines(), "make licences"


def test_licences_and_extras_of_packages_that_are_known() -> None:
    found = {package.name: package for package in licences.packages()}
    assert found["mpmath"].extras == ("all",)  # of torch's sympy
    assert found["numpy"].licence.startswith("BSD-3-Clause")
    assert {"sim", "corral"} < {*found["pybullet"].extras}
    assert not {"studies", "sklearn", "onnx", "control"} & {*found["pybullet"].extras}
    assert found["scikit-learn"].version == metadata.version("scikit-learn")
    assert "not said" not in {package.licence for package in found.values()}


def test_every_extra_has_a_job_and_a_size() -> None:
    import jobs

    extras = set(release_check.known_extras())
    assert extras == set(PROJECT["optional-dependencies"]) - {"dev"}
    assert extras <= set(jobs.JOBS)
    sizes = INSTALL.split("<!-- sizes: begin -->")[1].split("<!-- sizes: end -->")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", sizes, re.MULTILINE)) == extras


def test_the_same_pythons_are_named_everywhere() -> None:
    named = {line.split(" :: ")[-1] for line in PROJECT["classifiers"] if ":: Python :: 3." in line}
    checked = {name.removeprefix("python") for name in release_check.OTHER_PYTHONS} | {"3.11"}
    rows = INSTALL.split("| what is tested |")[1].split("\n\n")[0]
    assert named == checked == set(re.findall(r"\b3\.\d+\b", rows))
    assert min(checked, key=lambda version: int(version[2:])) == PROJECT["requires-python"].removeprefix(">=")


def test_a_page_is_filled_between_its_marks_only() -> None:
    page = "a\n<!-- x: begin -->\nold\n<!-- x: end -->\nb"
    assert release_check.filled(page, "x", r"new \1") == "a\n<!-- x: begin -->\nnew \\1\n<!-- x: end -->\nb"
    with pytest.raises(ValueError, match="y: begin"):
        release_check.filled(page, "y", "new")
