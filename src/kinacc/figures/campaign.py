"""A measuring campaign: every measured point with its limits, and the bounds as they grew."""

from __future__ import annotations

from collections.abc import Mapping

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
    """Draw ``campaign_points`` and ``campaign_bounds``; ``first_visit`` readings come unasked."""
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 2.9)
        left, right = figure.subplots(1, 2, sharey=True)
        _sizes(left, pd.DataFrame(dict(points)))
        _growth(right, pd.DataFrame(dict(bounds)), first_visit)
        if tolerance_mm is not None:
            for ax in (left, right):
                ax.axhline(tolerance_mm, **style.LIMIT)
            top = max(right.get_ylim()[1], tolerance_mm)
            style.outside_label(right, tolerance_mm / top, "tolerance", style.VERMILION)
        left.set_ylim(bottom=0.0)
        style.name_dataset(figure, name)
    return figure


def readings(table: Mapping, tolerance_mm: float | None = None) -> Figure:
    """Draw ``campaign_readings`` in the order taken, by instrument."""
    rows = pd.DataFrame(dict(table))
    struck = rows["struck"].astype(bool)
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 2.2)
        ax = figure.subplots()
        for number, (name, own) in enumerate(rows[~struck].groupby("instrument", sort=False)):
            colour, marker = style.SERIES[number % len(style.SERIES)]
            ax.plot(own["reading"], own["error_mm"], marker, ms=2.5, color=colour,
                    label=style.literal(str(name)))  # fmt: skip
        if struck.any():
            out = rows[struck]
            ax.plot(out["reading"], out["error_mm"], "x", color=style.VERMILION, label="struck")
        if tolerance_mm is not None:
            ax.axhline(tolerance_mm, **style.LIMIT)
        ax.set(xlabel="Reading, in the order taken", ylabel="Distance from the model, mm")
        ax.set_ylim(bottom=0.0)
        style.legend_above(ax)
    return figure


def _sizes(ax: Axes, points: pd.DataFrame) -> None:
    ax.set(xlabel="Measured points, largest first", ylabel="Size of the error, mm")
    read = points.dropna(subset="error_mm").sort_values("error_mm", ascending=False, kind="stable")
    if read.empty:
        return
    read["place"] = np.arange(1, len(read) + 1)
    ax.vlines(read["place"], read["lower_mm"], read["upper_mm"], color=style.SKY, lw=0.8, zorder=1)
    for again, own in read.groupby(read["readings"] > 1):
        marker, colour, label = (
            ("D", style.ORANGE, "read again") if again else ("o", style.BLUE, "read once")
        )
        ax.plot(own["place"], own["error_mm"], marker, ms=2.5, color=colour, label=label)
    style.legend_above(ax, title="mean reading, with limits")


def _growth(ax: Axes, bounds: pd.DataFrame, first_visit: int) -> None:
    for target, rows in bounds.groupby("target", sort=False):
        label, colour, dashes = _TARGETS[str(target)]
        if left := int(rows["excepted"].iloc[-1]):
            label = f"all but {left} candidate{'s' if left > 1 else ''}"
        count, lower, upper = rows["readings"], rows["lower_mm"], rows["upper_mm"]
        if upper.isna().all() and rows["value_mm"].isna().all():
            continue
        ax.plot(count, upper, color=colour, ls=dashes, label=f"bounds, {label}")
        ax.plot(count, lower, color=colour, ls=dashes)
        if target == "measured":
            ax.fill_between(count, lower, upper, color=colour, alpha=0.12, lw=0)
            ax.plot(count, rows["value_mm"], color=style.INK, lw=0.8, label="estimate")
    if ax.lines:
        style.legend_above(ax)
    else:
        ax.text(0.5, 0.5, "no bound yet", transform=ax.transAxes, ha="center")
    ax.axvline(first_visit, color=style.FAINT, lw=0.8, zorder=0)
    ax.set(xlabel="Readings")
