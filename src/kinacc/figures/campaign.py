"""Pictures of campaigns and of plans: bounds as they grow, readings, budgets, chosen poses."""

from __future__ import annotations

from itertools import cycle

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.figures import style
from kinacc.tables.columns import Columns

_TARGETS = {
    "measured": ("measured points", style.BLUE, "-"),
    "candidates": ("all candidates", style.PURPLE, (0, (4, 1.5))),
    "region": ("share of the region", style.GREEN, (0, (1, 1))),
}


def draw_bounds(
    points: Columns,
    bounds: Columns,
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
    with style.new_figure(style.DOUBLE_COLUMN_IN, 2.9, name) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        style.draw_limit(left, tolerance_mm)
        style.draw_limit(right, tolerance_mm, "tolerance")
        _sizes(left, pd.DataFrame(points))
        _growth(right, pd.DataFrame(bounds), first_visit)
        left.set_ylim(bottom=0.0)
    return figure


def draw_readings(table: Columns, tolerance_mm: float | None = None) -> Figure:
    """Draw ``campaign_readings`` in the order taken, by instrument."""
    rows = pd.DataFrame(table)
    rows["instrument"] = rows["instrument"].astype(str).map(style.literal)
    rows.loc[rows["struck"].astype(bool), "instrument"] = "struck"
    with style.new_figure(style.DOUBLE_COLUMN_IN, 2.2) as figure:
        ax = figure.subplots()
        looks = cycle(style.SERIES)
        for name, group in rows.groupby("instrument", sort=False):
            colour, marker = (style.VERMILION, "x") if name == "struck" else next(looks)
            ax.plot(group["reading"], group["error_mm"], marker, ms=2.5, color=colour, label=name)
        style.draw_limit(ax, tolerance_mm, "tolerance")
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


def draw_budgets(
    rows: pd.DataFrame, wanted_mm: float | None, power: float | None, enough: int | None
) -> Figure:
    """Draw the distance between the bounds, and the share of campaigns that reach the aim.

    Parameters
    ----------
    rows
        By ``errors`` and ``budget``: quantiles of the width, ``width_q05_mm``, ``width_median_mm``
        and ``width_q95_mm``, infinite where no bound is stated, and ``share`` that reach the aim.
    wanted_mm, power
        Width and share that are wanted.
    enough
        The smallest budget that does.

    Notes
    -----
    Bands reach from the narrow to the wide campaigns; to the top where more than 5 % state no
    bound.
    """
    names = ["width_q05_mm", "width_median_mm", "width_q95_mm"]
    widths = rows[names].to_numpy(dtype=float)
    top = 1.08 * max(widths[np.isfinite(widths)].max(initial=0.0), wanted_mm or 0.0) or 1.0
    share = "Share with a bound" if power is None else "Share that reach the aim"
    with style.new_figure(style.DOUBLE_COLUMN_IN, 3.0) as figure:
        left, right = figure.subplots(1, 2, sharex=True)
        groups = rows.groupby("errors", sort=False)
        for (name, group), (colour, marker) in zip(groups, cycle(style.SERIES), strict=False):
            low, middle, high = group[names].to_numpy(dtype=float).T
            high = np.where(np.isfinite(high), high, top)
            left.fill_between(group["budget"], low, high, where=np.isfinite(low), color=colour,
                              alpha=0.15, lw=0.5)  # fmt: skip
            middle = np.where(np.isfinite(middle), middle, np.nan)
            look = {"color": colour, "marker": marker, "ms": 3}
            left.plot(group["budget"], middle, label=style.literal(str(name)), **look)
            right.plot(group["budget"], group["share"], **look)
        style.draw_limit(left, wanted_mm, f"wanted ({wanted_mm:g} mm)" if wanted_mm else None)
        style.draw_limit(right, power, f"wanted ({power:.0%})" if power else None)
        if enough is not None:
            left.axvline(enough, color=style.MUTED, lw=0.8, ls=":")
            right.axvline(enough, color=style.MUTED, lw=0.8, ls=":", label=f"{enough} readings")
        left.set(ylim=(0.0, top), xlabel="Readings allowed", ylabel="Upper minus lower bound, mm")
        right.set(ylim=(0.0, 1.04), xlabel="Readings allowed", ylabel=share)
        title = "median, 5 to 95 % of campaigns; to the top where some state no bound"
        figure.legend(loc="outside lower center", ncols=4, title=title)
    return figure


def draw_observability(index: np.ndarray, robot: str) -> Figure:
    """Draw the observability index against the number of poses.

    Parameters
    ----------
    index
        O1 (n,) after each added pose, the last one after all swaps, mm or mrad.
    robot
        Name above the figure.
    """
    with style.new_figure(style.SINGLE_COLUMN_IN, 2.6, robot) as figure:
        ax = figure.subplots()
        ax.plot(np.arange(1, len(index) + 1), index, color=style.BLUE, marker="o", ms=3)
        ax.set(
            xlabel="Poses", ylabel="O1 (mm or mrad)", ylim=(0.0, 1.18 * float(index.max()) or 1.0)
        )
    return figure
