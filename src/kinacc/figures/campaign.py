"""A measuring campaign: every measured point with its limits, and the bounds as they grew."""

from __future__ import annotations

from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.figures import style
from kinacc.tables.columns import Columns

_TARGETS = {
    "measured": ("measured points", style.BLUE, "-"),
    "candidates": ("all candidates", style.PURPLE, (0, (4, 1.5))),
    "region": ("share of the region", style.GREEN, (0, (1, 1))),
}
_INSTRUMENTS = ((style.BLUE, "o"), (style.ORANGE, "^"), (style.GREEN, "s"), (style.PURPLE, "D"))


def draw(
    points: Columns,
    bounds: Columns,
    first_visit: int,
    tolerance_mm: float | None = None,
    name: str | None = None,
) -> Figure:
    """Draw ``campaign_points`` and ``campaign_bounds``; ``first_visit`` readings come unasked."""
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 2.9)
        left, right = figure.subplots(1, 2, sharey=True)
        _sizes(left, points)
        _growth(right, bounds, first_visit)
        if tolerance_mm is not None:
            for ax in (left, right):
                ax.axhline(tolerance_mm, color=style.VERMILION, lw=1.0, ls=(0, (6, 2)))
            style.outside_label(right, _place(right, tolerance_mm), "tolerance", style.VERMILION)
        left.set_ylim(bottom=0.0)
        style.name_dataset(figure, name)
    return figure


def readings(table: Columns, tolerance_mm: float | None = None) -> Figure:
    """Draw ``campaign_readings`` in the order taken, by instrument."""
    names = np.asarray(table["instrument"]).astype(str)
    struck = np.array([bool(each) for each in table["struck"]])
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 2.2)
        ax = figure.subplots()
        for name, (colour, marker) in zip(dict.fromkeys(names), cycle(_INSTRUMENTS), strict=False):
            mine = (names == name) & ~struck
            size = np.asarray(table["error_mm"])[mine]
            number = np.asarray(table["reading"])[mine]
            ax.plot(number, size, marker, ms=2.5, color=colour, label=style.literal(name))
        if struck.any():
            at, size = (np.asarray(table[each])[struck] for each in ("reading", "error_mm"))
            ax.plot(at, size, "x", color=style.VERMILION, label="struck")
        if tolerance_mm is not None:
            ax.axhline(tolerance_mm, color=style.VERMILION, lw=1.0, ls=(0, (6, 2)))
        ax.set(xlabel="Reading, in the order taken", ylabel="Distance from the model, mm")
        ax.set_ylim(bottom=0.0)
        _legend_above(ax)
    return figure


def _sizes(ax: Axes, points: Columns) -> None:
    size = np.asarray(points["error_mm"], dtype=float)
    read = np.flatnonzero(~np.isnan(size))
    order = read[np.argsort(-size[read], kind="stable")]
    lower, upper = (np.asarray(points[end], dtype=float)[order] for end in ("lower_mm", "upper_mm"))
    place, again = np.arange(1, len(order) + 1), np.asarray(points["readings"])[order] > 1
    ax.vlines(place, lower, upper, color=style.SKY, lw=0.8, zorder=1)
    for chosen, marker, label in ((~again, "o", "read once"), (again, "D", "read again")):
        if chosen.any():
            colour = style.ORANGE if marker == "D" else style.BLUE
            ax.plot(place[chosen], size[order][chosen], marker, ms=2.5, color=colour, label=label)
    ax.set(xlabel="Measured points, largest first", ylabel="Size of the error, mm")
    if len(order):
        _legend_above(ax, "mean reading, with limits")


def _growth(ax: Axes, bounds: Columns, first_visit: int) -> None:
    drawn = False
    for target in dict.fromkeys(bounds["target"]):
        words, colour, dashes = _TARGETS[target]
        rows = np.flatnonzero(np.asarray(bounds["target"]) == target)
        if left := int(np.asarray(bounds["excepted"])[rows[-1]]):
            words = f"all but {left} candidate{'s' if left > 1 else ''}"
        readings = np.asarray(bounds["readings"], dtype=float)[rows]
        lower, value, upper = (
            np.asarray(bounds[f"{which}_mm"], dtype=float)[rows]
            for which in ("lower", "value", "upper")
        )
        if np.isnan(upper).all() and np.isnan(value).all():
            continue
        drawn = True
        ax.plot(readings, upper, color=colour, ls=dashes, label=f"bounds, {words}")
        ax.plot(readings, lower, color=colour, ls=dashes)
        if target == "measured":
            ax.fill_between(readings, lower, upper, color=colour, alpha=0.12, lw=0)
            ax.plot(readings, value, color=style.INK, lw=0.8, label="estimate")
    ax.axvline(first_visit, color=style.FAINT, lw=0.8, zorder=0)
    ax.set(xlabel="Readings")
    if drawn:
        _legend_above(ax)
    else:
        ax.text(0.5, 0.5, "nothing can be said yet", transform=ax.transAxes, ha="center")


def _legend_above(ax: Axes, title: str | None = None) -> None:
    """Where it covers no limits, however many points there are."""
    ax.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=2,
        title=title,
        title_fontsize=style.SMALL_PT,
        alignment="left",
    )


def _place(ax: Axes, height: float) -> float:
    low, high = ax.get_ylim()
    return (height - min(low, 0.0)) / (max(high, height) - min(low, 0.0))
