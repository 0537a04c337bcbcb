"""The style of all figures, and curves of tidy frames with seaborn.

Matplotlib and seaborn are imported by what draws, for that takes a second, and processes that measure draw nothing.
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import pandas as pd

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, which stay apart for colour-blind readers, and two that go with them.
BLACK, ORANGE, SKY, GREEN = "#222222", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PINK, GREY = "#0072B2", "#D55E00", "#CC79A7", "#8A949E"
PURPLE, SLATE = "#7B5EA7", "#5B6875"
PALETTE = (BLUE, VERMILION, GREEN, ORANGE, SKY, PINK, PURPLE, SLATE, BLACK, GREY)
MARKERS = ("D", "v", "o", "^", "s", "P", "X", "d", "h", "*")

Look = tuple[str, str]
"""Colour and marker."""

STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#5B6875",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E3E8EC",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "hatch.linewidth": 0.6,
}


def drawn(draw: Callable[[], Figure]) -> bytes:
    """What `draw` draws in the style of all figures, as the bytes of a PNG file."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        return png(draw())


def png(figure: Figure, dpi: int = 120) -> bytes:
    """A figure as the bytes of a PNG file; the same figure gives the same bytes."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    buffer = io.BytesIO()
    figure.set_dpi(dpi)
    with matplotlib.rc_context(STYLE):
        # `savefig` draws twice where there is a layout engine. Without the version of matplotlib, which it would write
        # into the file.
        FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": None})
    return buffer.getvalue()


def looks(names: Sequence[str], fixed: Mapping[str, Look] | None = None) -> dict[str, Look]:
    """A colour and a marker for each name: the `fixed` ones, and others in order for the rest."""
    free = zip(PALETTE, MARKERS, strict=True)
    found = dict(fixed or {})
    taken = set(found.values())
    rest = [look for look in free if look not in taken]
    for name in names:
        if name not in found:
            found[name] = rest.pop(0) if rest else (GREY, "o")
    return {name: found[name] for name in names}


def lines(
    axes: Axes,
    frame: pd.DataFrame,
    x: str,
    y: str,
    hue: str,
    *,
    order: Sequence[Any] | None = None,
    low: str | None = None,
    high: str | None = None,
    fixed: Mapping[str, Look] | None = None,
    dashed: Collection[str] = (),
    apart: float = 0.0,
) -> None:
    """Draw a line for each value of `hue`, in that `order` or the frame's; `low` and `high` are columns of a band.

    Without those two, rows with the same x are repeats: the line is their median, the band lowest to highest. The lines
    of the names `dashed` are dashed. Lines that are `apart` are each moved by this much along x against the one before,
    and have bars instead of bands, so that no interval hides another.
    """
    import seaborn

    names = [name for name in order or dict.fromkeys(frame[hue]) if (frame[hue] == name).any()]
    chosen = looks(names, fixed)
    colours = {name: look[0] for name, look in chosen.items()}
    markers = {name: look[1] for name, look in chosen.items()}
    dashes: dict[Any, Any] = {name: (4, 2) if name in dashed else "" for name in names}
    moved = {name: apart * (place - (len(names) - 1) / 2) for place, name in enumerate(names)}
    frame = frame.assign(**{x: frame[x] + [moved.get(name, 0.0) for name in frame[hue]]}) if apart else frame
    seaborn.lineplot(
        frame, x=x, y=y, hue=hue, style=hue, hue_order=names, style_order=names, palette=colours, markers=markers,
        dashes=dashes, estimator="median", errorbar=None if low is not None else ("pi", 100), ax=axes, markersize=5.5,
        markeredgewidth=0, linewidth=1.4, err_kws={"alpha": 0.15, "linewidth": 0},
    )  # fmt: skip
    if low is not None and high is not None:
        for name in names:
            own = frame.loc[frame[hue] == name].sort_values(by=x)
            if apart:
                axes.vlines(own[x], own[low], own[high], color=colours[name], alpha=0.4, linewidth=1.6)
            else:
                axes.fill_between(own[x], own[low], own[high], color=colours[name], alpha=0.15, linewidth=0)


def by_measure(table: Sequence[Mapping[str, Any]], measures: Mapping[str, Sequence[str]]) -> pd.DataFrame:
    """The rows of a table for each measure that they have: its name as `measure`, and its `value`, `low` and `high`.

    `measures` maps a name to these columns of the table; a measure without an interval has the first only.
    """
    frame = pd.DataFrame(table)
    parts = []
    for name, columns in measures.items():
        numbers = {new: frame[old].astype(float) for new, old in zip(("value", "low", "high"), columns, strict=False)}
        parts.append(frame.assign(measure=name, **numbers))
    return pd.concat(parts).reindex(columns=[*frame, "measure", "value", "low", "high"]).dropna(subset="value")


def panels(
    frame: pd.DataFrame, x: str, hue: str, row: str, column: str, size: tuple[float, float], **looks: Any
) -> tuple[Figure, dict[tuple[Any, Any], Axes]]:
    """A figure of a frame of `by_measure`: `lines` in a panel for each value of `row` and of `column`.

    `size` is that of a panel in inches; `looks` are options of `lines`. Returns the panels by the two values.
    """
    from matplotlib.figure import Figure

    rows, columns = frame[row].unique(), frame[column].unique()
    width, height = size[0] * len(columns), size[1] * len(rows)
    figure = Figure(figsize=(max(0.9 + width, 5.4), 0.9 + height), layout="constrained")
    grid = figure.subplots(len(rows), len(columns), sharex="col", sharey="row", squeeze=False)
    found = dict(zip(itertools.product(rows, columns), grid.ravel(), strict=True))
    for (one, other), axes in found.items():
        here = frame.loc[(frame[row] == one) & (frame[column] == other)]
        lines(axes, here, x, "value", hue, low="low", high="high", **looks)
        axes.set(
            xlabel=x if one == rows[-1] else "",
            ylabel=one if other == columns[0] else "",
            title=other if one == rows[0] else "",
        )
    return figure, found


def legend_below(figure: Figure, axes: Axes | None = None, columns: int | None = None) -> None:
    """One legend for the whole figure, below it, with the entries of one panel, or of all."""
    entries: dict[str, Any] = {}
    for panel in figure.axes if axes is None else [axes]:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    for panel in figure.axes:
        if (legend := panel.get_legend()) is not None:
            legend.remove()
    names = [label.replace("_", " ") for label in entries]
    figure.legend(list(entries.values()), names, loc="outside lower center", ncols=columns or min(len(names), 5))
