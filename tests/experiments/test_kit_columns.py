"""Tables: one declaration for terminal, page and Markdown; intervals."""

import io

import numpy as np
import pandas as pd
import pytest
from rich.console import Console
from scipy import stats

from experiments.kit import Column, Table, aggregated, pivot
from experiments.kit.figures import by_measure
from experiments.kit.intervals import bootstrap, mean, proportion

ROWS = [
    {"name": "a", "rate": 0.5, "low": 0.25, "high": 0.75, "starts": 10, "seconds": 3.0, "note": None},
    {"name": "b", "rate": 0.75, "low": 0.5, "high": 1.0, "starts": 20, "seconds": 2.0, "note": None},
    {"name": "c", "rate": None, "low": None, "high": None, "starts": 1000, "seconds": float("nan"), "note": None},
]
TABLE = Table(
    "Rates",
    [
        Column("name"),
        Column("rate", "rate [95 %]", ".2f", ("low", "high"), best="max", alike="starts"),
        Column("starts"),
        Column("seconds", format=".1f", best="min"),
        Column("note"),
    ],
).show(ROWS)


def test_markdown_has_intervals_dashes_and_the_best_of_what_compares() -> None:
    assert TABLE.markdown().splitlines() == [
        "| name | rate [95 %] | starts | seconds |",
        "| --- | ---: | ---: | ---: |",
        "| a | 0.50 [0.25, 0.75] | 10 | 3.0 |",
        "| b | 0.75 [0.50, 1.00] | 20 | **2.0** |",
        "| c | - | 1,000 | - |",
    ]


@pytest.mark.parametrize(("width", "parts"), [(20, 3), (30, 2), (46, 2), (47, 1), (100, 1)])
def test_a_terminal_shows_the_same_however_narrow_it_is(width: int, parts: int) -> None:
    shown = io.StringIO()
    TABLE.print(Console(file=shown, width=width, force_terminal=True, color_system=None))
    lines = shown.getvalue().splitlines()
    assert max(map(len, lines)) <= max(width, len("│ name │ 0.50 [0.25, 0.75] │"))
    assert sum("1,000" in line for line in lines) == 1
    for text in ("Rates", "0.50 [0.25, 0.75]", "2.0"):
        assert shown.getvalue().count(text) == 1
    assert "note" not in shown.getvalue()
    # Each part has the first column.
    assert sum("│ b " in line for line in lines) == parts


def test_each_part_of_a_wide_table_says_what_its_rows_are() -> None:
    columns = [Column("vsa"), Column("encoder"), *(Column(f"measure{number}") for number in range(6))]
    rows = [{"vsa": "map", "encoder": "level"} | {f"measure{number}": number for number in range(6)}]
    shown = io.StringIO()
    Table("", columns).show(rows).print(Console(file=shown, width=60, force_terminal=True, color_system=None))
    found = [[cell.strip() for cell in line.split("│")[1:-1]] for line in shown.getvalue().splitlines() if "│" in line]
    assert found == [["map", "level", "0", "1", "2"], ["map", "level", "3", "4", "5"]]


def test_a_file_gets_long_lines() -> None:
    shown = io.StringIO()
    TABLE.print(Console(file=shown, width=20))
    lines = shown.getvalue().splitlines()
    assert any(all(text in line for text in ("b", "0.75 [0.50, 1.00]", "20", "2.0")) for line in lines)


def test_nothing_is_best_among_equals_or_on_other_samples() -> None:
    best = Column("rate", best="max", alike="starts")
    assert not any(cell.mark for cell in best.cells(ROWS[:2]))
    alike = [{**row, "starts": 10} for row in ROWS]
    assert [cell.mark for cell in best.cells(alike)] == ["", "best", ""]
    assert not any(cell.mark for cell in best.cells([alike[0], alike[0]]))
    assert [cell.mark for cell in Column("rate", bad=lambda rate: rate < 0.6).cells(ROWS)] == ["bad", "", ""]


@pytest.mark.parametrize(("successes", "trials"), [(0, 7), (3, 7), (7, 7), (999, 1000)])
def test_a_proportion_has_wilsons_interval(successes: int, trials: int) -> None:
    found = stats.binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    expected = {"success_rate": successes / trials, "success_low": found.low, "success_high": found.high}
    assert proportion("success", successes, trials) == pytest.approx(expected, abs=1e-12)


def test_no_trials_have_no_interval() -> None:
    assert proportion("x", 0, 0) == {"x_rate": None, "x_low": None, "x_high": None}
    with pytest.raises(ValueError, match="2 successes of 1"):
        proportion("x", 2, 1)


def test_a_mean_has_the_bootstrap_of_several_draws_and_none_of_one() -> None:
    low, high = bootstrap([1.0, 2.0, 6.0])
    assert mean("x", pd.Series([1, 2, 6])) == {"x": 3.0, "x_low": low, "x_high": high}
    assert 1 <= low < 3 < high <= 6
    assert mean("x", [2.5]) == {"x": 2.5, "x_low": None, "x_high": None}
    assert mean("x", []) == {"x": None, "x_low": None, "x_high": None}


def test_the_bootstrap_covers_the_mean_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    covered = 0
    for draw in range(200):
        low, high = bootstrap(rng.normal(3.0, 1.0, 40).tolist(), seed=draw, draws=400)
        covered += low <= 3.0 <= high
    assert 0.88 <= covered / 200 <= 0.98  # 40 values make it a little narrow
    assert bootstrap([1.0, 2.0, 4.0], seed=1) == bootstrap([1.0, 2.0, 4.0], seed=1)
    assert np.isnan(bootstrap([1.0])).all()
    with pytest.raises(ValueError, match="at least one value"):
        bootstrap([])


def test_records_are_aggregated_in_the_order_of_the_records_or_of_cells() -> None:
    records = pd.DataFrame(
        {"learner": ["b", "b", "a"], "dim": [2, 2, None], "recall": [0.1, 0.4, 0.9], "won": [3, 4, 5]}
    )
    columns = {"recall": ("recall", "mean"), "least": ("recall", "min"), "won": ("won", "sum")}
    b = {"learner": "b", "dim": 2, "recall": 0.25, "least": 0.1, "won": 7}
    a = {"learner": "a", "dim": None, "recall": 0.9, "least": 0.9, "won": 5}
    assert aggregated(records, ["learner", "dim"], columns) == [b, a]
    order = [{"learner": "a", "dim": None}, {"learner": "b", "dim": 2}]
    assert aggregated(records, ["learner", "dim"], columns, order) == [a, b]


def test_a_pivot_has_a_column_for_each_value_and_marks_the_best_of_each() -> None:
    rows = [
        {"learner": "a", "dim": 2, "recall": 0.5, "low": 0.4, "high": 0.6},
        {"learner": "a", "dim": 3, "recall": 0.7, "low": 0.6, "high": 0.8},
        {"learner": "b", "dim": 2, "recall": 0.9, "low": 0.8, "high": 1.0},
    ]
    value = Column("recall", "", ".1f", ("low", "high"), best="max")
    table = pivot("Recall", rows, [Column("learner")], Column("dim"), value, "by dimension")
    assert [column.title for column in table.columns] == ["learner", "2", "3"]
    assert [[cell.text for cell in line] for line in table.cells] == [
        ["a", "0.5 [0.4, 0.6]", "0.7 [0.6, 0.8]"],
        ["b", "0.9 [0.8, 1.0]", "-"],
    ]
    assert [line[1].mark for line in table.cells] == ["", "best"]


def test_a_table_by_measure_has_a_row_for_each_value_that_was_measured() -> None:
    table = [{"learner": "a", "recall": 0.5, "won": None}, {"learner": "b", "recall": 0.7, "won": 3, "won_low": 2}]
    frame = by_measure(table, {"share recalled": ["recall"], "games won": ["won", "won_low"]})
    assert frame[["learner", "measure", "value"]].to_numpy().tolist() == [
        ["a", "share recalled", 0.5],
        ["b", "share recalled", 0.7],
        ["b", "games won", 3.0],
    ]
    assert frame.low.fillna(0).tolist() == [0, 0, 2]
