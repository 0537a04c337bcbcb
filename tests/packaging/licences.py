"""Write `docs/licences.md`: what each extra installs, under which licence, from the metadata of installed packages.

`make licences` calls it. Packages of the page that are not installed here keep their rows.
"""

import re
import tomllib
from importlib import metadata
from typing import NamedTuple

from packages import ROOT
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PAGE = ROOT / "docs" / "licences.md"
TITLE = """\
<!-- Written by `make licences` from the metadata of the installed packages; a test compares the two. -->
# Licences

torchvsa is under the MIT licence; the data in `behaviours/data/wall_following` are under CC BY 4.0. These packages are
installed with it, on Linux and Python 3.11, with PyTorch for the CPU. The licence is what a package says of itself.
Wheels may contain libraries under others, as NumPy's has OpenBLAS; their own licence files list them. `all`: needed
without any extra.

| package | version | licence | extras that need it |
|---|---|---|---|
"""


class Package(NamedTuple):
    """An installed distribution."""

    name: str
    version: str
    licence: str
    extras: tuple[str, ...]

    def row(self) -> str:
        """A line of the page."""
        return f"| {self.name} | {self.version} | {self.licence} | {', '.join(self.extras)} |"


def packages() -> list[Package]:
    """The installed packages that torchvsa or one of its extras needs, also indirectly."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    always = needed(project["dependencies"], extras)
    users: dict[str, list[str]] = {name: ["all"] for name in always}
    for extra in extras:
        for name in needed(extras[extra], extras) - always:
            users.setdefault(name, []).append(extra)
    found = []
    for name, who in users.items():
        try:
            about = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue
        found.append(Package(about.metadata["Name"], about.version.split("+")[0], licence(about), tuple(who)))
    return sorted(found, key=lambda package: canonicalize_name(package.name))


def needed(requirements: list[str], extras: dict[str, list[str]]) -> set[str]:
    """The names of all packages that these requirements bring, with those of the extras of torchvsa that they name."""
    found: set[tuple[str, str]] = set()
    waiting = [Requirement(line) for line in requirements]
    while waiting:
        wanted = waiting.pop()
        name = canonicalize_name(wanted.name)
        if wanted.marker is not None and not wanted.marker.evaluate({"extra": ""}):
            continue
        if name == "torchvsa":
            waiting += [Requirement(line) for extra in wanted.extras for line in extras[extra]]
            continue
        for extra in {"", *wanted.extras}:
            if (name, extra) not in found:
                found.add((name, extra))
                waiting += required_by(name, extra)
    return {name for name, _ in found}


def required_by(name: str, extra: str) -> list[Requirement]:
    """What an installed package requires, for one of its extras or without."""
    try:
        lines = metadata.requires(name) or []
    except metadata.PackageNotFoundError:
        return []
    requirements = [Requirement(line) for line in lines]
    wanted = [one for one in requirements if one.marker is None or one.marker.evaluate({"extra": extra})]
    for one in wanted:
        one.marker = None
    return wanted


def licence(about: metadata.Distribution) -> str:
    """What the metadata say: the expression, else the classifiers, else the first line of the text."""
    fields = about.metadata
    classified = [
        line.split(" :: ")[-1] for line in fields.get_all("Classifier") or [] if line.startswith("License :: ")
    ]
    classified = [name for name in classified if name != "OSI Approved"]
    text = "\n".join(fields.get_all("License") or []).strip().split("\n")[0]
    said = "".join(fields.get_all("License-Expression") or []) or "; ".join(classified) or text
    return re.sub(r"\s+", " ", said.replace("|", "/")) or "not said"


def page() -> str:
    """The page; rows of packages that are not installed here are those of the page as it is."""
    rows = {canonicalize_name(package.name): package.row() for package in packages()}
    if PAGE.is_file():
        for row in re.findall(r"^\| .* \|$", PAGE.read_text(), re.MULTILINE)[1:]:
            rows.setdefault(canonicalize_name(row.split("|")[1].strip()), row)
    return TITLE + "\n".join(row for _, row in sorted(rows.items())) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
