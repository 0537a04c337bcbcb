"""What every study is made with; it knows no robot and no study.

A study declares typed settings, a grid of cells and how a cell is measured. The kit does the rest: the command, the
pool, progress, going on after a stop, the table, the results and the page.
"""

from experiments.kit import parts
from experiments.kit.columns import Column, Table, aggregated, pivot
from experiments.kit.page import Page
from experiments.kit.settings import Part, Settings, part, setting, settings
from experiments.kit.study import STUDIES, Cell, Drawing, Outcome, Row, Study, grid

__all__ = [
    "STUDIES",
    "Cell",
    "Column",
    "Drawing",
    "Outcome",
    "Page",
    "Part",
    "Row",
    "Settings",
    "Study",
    "Table",
    "aggregated",
    "grid",
    "part",
    "parts",
    "pivot",
    "setting",
    "settings",
]
