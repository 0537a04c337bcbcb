"""The studies of memories: rows are measured as they say, and the search finds the operational capacity."""

from pathlib import Path
from typing import cast

import pytest
from commands import only, output_of, results
from kits import composed

from experiments import memories, resonator
from experiments.kit.run import check_all


def test_the_table_finds_every_item_and_crowded_networks_do_not() -> None:
    settings = cast(memories.Memories, composed(memories.study, "dim=200", "items=[5,60]", "noise=[0.1]", "queries=40"))
    rows = {
        (name, count): memories.measure(settings, {"memory": name, "items": count, "repeat": 0})[0]
        for name in ("clean_up", "hopfield", "outer_product")
        for count in (5, 60)
    }
    assert rows["clean_up", 60]["accuracy"] == rows["hopfield", 60]["accuracy"] == 1
    assert rows["clean_up", 60]["completed"] == pytest.approx(1)
    assert rows["clean_up", 60]["bytes"] == 60 * 200
    assert rows["outer_product", 5]["completed"] > 0.99
    assert rows["outer_product", 60]["completed"] < 0.9
    with pytest.raises(ValueError, match="the projection rule holds at most dim=100"):
        check_all(memories.study, composed(memories.study, "dim=100"))


def test_the_capacity_found_holds_and_the_next_one_does_not() -> None:
    overrides = ("dims=[100]", "factors=[2]", "trials=40", "draws=2", "precision=0.0")
    settings = cast(resonator.Resonators, composed(resonator.study, *overrides))
    cell = {"variant": "plain", "factors": 2, "dim": 100}
    size = resonator.measure(settings, cell)["size"]
    assert resonator.share(settings, cell, size) >= 0.99 > resonator.share(settings, cell, size + 1)
    assert 4 < size < 60


def test_the_commands_write_tables_and_pages(tmp_path: Path) -> None:
    for name, extra in (("memories", "memories=[clean_up,projection]"), ("resonator", "dims=[100]")):
        folder = tmp_path / name
        folder.mkdir()
        output_of(folder, name, "experiment=quick", extra, "workers=1")
        table = results(folder)["table"]
        assert only(folder, "report.html").read_text().count("data:image/png;base64,") == 1
        if name == "resonator":
            sizes = {(row["variant"], row["factors"]): row["products"] for row in table}
            assert sizes["stochastic", 2] > sizes["plain", 2] > 100
        else:
            assert {row["accuracy"] for row in table if row["memory"] == "clean_up"} == {1.0}
