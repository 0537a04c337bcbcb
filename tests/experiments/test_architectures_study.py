"""The study of architectures: what is refused, what is measured, and the command."""

from pathlib import Path
from typing import cast

import pytest
from commands import only, output_of, results
from kits import composed

from experiments import architectures
from experiments.kit.run import check_all
from torchvsa import ARCHITECTURES


def test_what_is_not_supported_is_left_out_with_the_reason() -> None:
    settings = cast(architectures.Architectures, composed(architectures.study))
    found = {(cell["architecture"], cell["encoder"]) for cell in architectures.cells(settings)}
    assert {name for name, _ in found} == set(ARCHITECTURES)
    assert ("BSDC-S", "threshold_features") not in found
    assert "negate" in architectures.refusal(settings, "BSDC-S", "threshold_features")
    assert "element-wise" in architectures.refusal(settings, "VTB", "subset_product of level")
    assert ("FHRR", "subset_product of thermometer") in found
    assert architectures.refusal(settings, "FHRR", "product of fractional_power") == ""
    for name, encoder in found:
        assert encoder in architectures.conditions(settings), name


def test_nothing_to_compare_is_refused() -> None:
    settings = composed(architectures.study, "architectures=[VTB]", "records=[subset_product]")
    with pytest.raises(ValueError, match="no architecture supports them; record: a subset of sensors per dimension"):
        check_all(architectures.study, settings)


def test_the_command_compares_and_draws(tmp_path: Path) -> None:
    output_of(
        tmp_path, "architectures", "experiment=quick", "architectures=[MAP-C,VTB]", "records=[product,subset_product]",
        "dim=400", "starts=4", "demonstrations=4", "seconds=20", "workers=1",
    )  # fmt: skip
    table = results(tmp_path)["table"]
    assert [(row["architecture"], row["encoder"]) for row in table] == [
        ("MAP-C", "product of level"),
        ("MAP-C", "subset_product of level"),
        ("VTB", "product of level"),
    ]
    by_name = {(row["architecture"], row["encoder"]): row for row in table}
    assert by_name["MAP-C", "product of level"]["bytes"] == 4 * 400
    assert by_name["VTB", "product of level"]["dim"] == 400
    for row in table:
        assert 0 <= row["worst"] <= row["success_rate"] <= 1
        assert row["train_agreement"] > 0.9
        assert row["pairs"] > 20
    page = only(tmp_path, "report.html").read_text()
    assert page.count("data:image/png;base64,") == 1
    assert "combinations of architecture and encoder reach the lamp" in page
    assert "needs element-wise binding" in page
