"""A measuring campaign: every measured point with its limits, and the bounds as they grew."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.figures import style

_TARGETS = {
    "measured": ("measured points", style.BLUE, "-"),
    "candidates": ("all candidates", style.PURPLE, (0, (4, 1.5))),
    "region": ("share of the region", style.GREEN, (0, (1, 1))),
}


def draw(
    points: Mapping,
    bounds: Mapping,
    first_visit: int,
    tolerance_mm: float | None = None,
    name: str | None = None,
) -> Figure:
    """Draw every measured point with its limits, and the bounds as they grew.

    Parameters
    ----------
    points, bounds
        Tables ``campaign_points`` and ``campaign_bounds``.
    first_visit
        Number of readings that are taken before the assessor chooses.
    tolerance_mm
        Largest error allowed.
    name
        Name above the figure.
    """
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 2.9)
        left, right = figure.subplots(1, 2, sharey=True)
        if tolerance_mm is not None:
            left.axhline(tolerance_mm, **style.LIMIT)
            right.axhline(tolerance_mm, **style.LIMIT, label="tolerance")
        _sizes(left, pd.DataFrame(dict(points)))
        _growth(right, pd.DataFrame(dict(bounds)), first_visit)
        left.set_ylim(bottom=0.0)
        style.name_dataset(figure, name)
    return figure


def readings(table: Mapping, tolerance_mm: float | None = None) -> Figure:
    """Draw ``campaign_readings`` in the order taken, by instrument."""
    rows = pd.DataFrame(dict(table))
    rows["instrument"] = rows["instrument"].astype(str).map(style.literal)
    rows.loc[rows["struck"].astype(bool), "instrument"] = "struck"
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 2.2)
        ax = figure.subplots()
        looks = cycle(style.SERIES)
        for name, group in rows.groupby("instrument", sort=False):
            colour, marker = (style.VERMILION, "x") if name == "struck" else next(looks)
            ax.plot(group["reading"], group["error_mm"], marker, ms=2.5, color=colour, label=name)
        if tolerance_mm is not None:
            ax.axhline(tolerance_mm, **style.LIMIT, label="tolerance")
        ax.set(xlabel="Reading, in the order taken", ylabel="Distance from the model, mm")
        ax.set_ylim(bottom=0.0)
        style.legend_above(ax, 4)
    return figure


def _sizes(ax: Axes, points: pd.DataFrame) -> None:
    ax.set(xlabel="Measured points, largest first", ylabel="Size of the error, mm")
    read = points.dropna(subset="error_mm").sort_values("error_mm", ascending=False, kind="stable")
    if read.empty:
        return
    read["place"] = np.arange(1, len(read) + 1)
    ax.vlines(read["place"], read["lower_mm"], read["upper_mm"], color=style.SKY, lw=0.8, zorder=1)
    looks = {False: ("o", style.BLUE, "read once"), True: ("D", style.ORANGE, "read again")}
    for again, group in read.groupby(read["readings"] > 1):
        marker, colour, label = looks[bool(again)]
        ax.plot(group["place"], group["error_mm"], marker, ms=2.5, color=colour, label=label)
    style.legend_above(ax, title="mean reading, with limits")


def _growth(ax: Axes, bounds: pd.DataFrame, first_visit: int) -> None:
    for target, rows in bounds.groupby("target", sort=False):
        label, colour, dashes = _TARGETS[str(target)]
        if excepted := int(rows["excepted"].iloc[-1]):
            label = f"all but {excepted} candidate{'s' if excepted > 1 else ''}"
        count, lower, upper = rows["readings"], rows["lower_mm"], rows["upper_mm"]
        if rows[["upper_mm", "value_mm"]].notna().any(axis=None):
            ax.plot(count, upper, color=colour, ls=dashes, label=f"bounds, {label}")
            ax.plot(count, lower, color=colour, ls=dashes)
            if target == "measured":
                ax.fill_between(count, lower, upper, color=colour, alpha=0.12, lw=0)
                ax.plot(count, rows["value_mm"], color=style.INK, lw=0.8, label="estimate")
    if bounds[["upper_mm", "value_mm"]].isna().all(axis=None):
        ax.text(0.5, 0.5, "no bound yet", transform=ax.transAxes, ha="center")
    ax.axvline(first_visit, color=style.FAINT, lw=0.8, zorder=0)
    ax.set(xlabel="Readings")
    style.legend_above(ax)
