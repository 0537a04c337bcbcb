"""The table of docs/architectures.md says what the architectures say of themselves."""

from pathlib import Path

import torchvsa

PAGE = Path(__file__).parents[2] / "docs" / "architectures.md"


def test_the_table_has_the_attributes_of_every_architecture() -> None:
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in PAGE.read_text().split("## What holds")[1].split("## ")[0].splitlines()
        if line.startswith("| ")
    ]
    head, *body = rows
    attributes = head[4:]
    assert attributes == ["exact", "commutative", "bilinear", "elementwise", "negatable"]
    assert [row[0] for row in body] == list(torchvsa.ARCHITECTURES)
    for name, kind, _, _, *answers in body:
        vsa = torchvsa.architecture_near(name, 400)
        assert kind == f"`{type(vsa).__name__}`"
        assert answers == ["yes" if getattr(vsa, attribute) else "no" for attribute in attributes], name
