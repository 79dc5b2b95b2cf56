"""A robot's history: errors, movement and temperature over the lines of its series."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure

from kinacc.figures import style
from kinacc.tables.allowed import FIRST, HOLDS, OPEN, RECALIBRATE
from kinacc.tables.columns import Columns

_CALIBRATIONS = (
    ("held_out", style.BLUE, "o", "calibrated on this line, held out"),
    ("in_force", style.ORANGE, "^", "calibration in force before"),
)
# Colour, marker and label of a verdict.
VERDICTS = {
    FIRST: (style.INK, "s", "first calibration"),
    HOLDS: (style.GREEN, "o", "holds"),
    RECALIBRATE: (style.VERMILION, "D", "recalibrate"),
    OPEN: (style.MUTED, "X", "cannot be told"),
}
_LEAST_SPAN_C = 1.0  # either way: less is no change worth a look


def draw(history: Columns, *, dataset: str | None = None) -> Figure:
    """Draw ``history``, one row a line by date.

    Above: position errors of the calibration made of each line at its held-out poses, and of the
    one in force before at the same line's poses; the tolerance. Below: what predictions moved since
    the calibration in force, beside what chance moves, marked by the verdict. Last the temperature,
    where it is stated.
    """
    lines = pd.DataFrame(history)
    lines.index = pd.Index(lines["date"].to_numpy("datetime64[D]").astype(float))
    warm = lines["temperature_c"].dropna()
    heights = [1.25, 1.0, 0.4][: 3 if len(warm) else 2]
    with style.new_figure(style.DOUBLE_COLUMN_IN, 1.75 * sum(heights) + 0.3, dataset) as figure:
        panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
        _errors(panels[0], lines)
        _moved(panels[1], lines)
        if len(warm):
            panels[2].plot(lines["temperature_c"], "o-", color=style.PURPLE, ms=2.0, lw=0.9)
            middle, span = 0.5 * (warm.min() + warm.max()), warm.max() - warm.min()
            half = max(0.6 * span, _LEAST_SPAN_C)
            panels[2].set(ylabel="°C", ylim=(middle - half, middle + half))
        for panel in panels:
            for day in lines.index[lines["verdict"] == RECALIBRATE]:
                panel.axvline(day, color=style.VERMILION, lw=0.7, ls=":", zorder=0.5)
            panel.grid(axis="x", visible=False)
        locator = AutoDateLocator(minticks=3, maxticks=9)  # type: ignore[no-untyped-call]
        panels[-1].xaxis.set_major_locator(locator)
        form = ConciseDateFormatter(locator, show_offset=False)  # type: ignore[no-untyped-call]
        panels[-1].xaxis.set_major_formatter(form)
        panels[-1].set_xlabel(f"{lines['date'].iloc[0]} to {lines['date'].iloc[-1]}")
    return figure


def _errors(ax: Axes, lines: pd.DataFrame) -> None:
    """Mean and 99 % as lines, the largest as marks, of both calibrations at each line's poses."""
    for name, colour, marker, label in _CALIBRATIONS:
        errors = [lines[f"{name}_{of}_mm"].dropna() for of in ("mean", "quantile_99", "largest")]
        ax.plot(errors[0], color=colour, marker=marker, ms=3.0, label=label)
        ax.plot(errors[1], color=colour, marker=marker, ms=3.0, mfc="white", ls="--", lw=1.0)
        ax.plot(errors[2], "x", color=colour, ms=3.0, mew=0.8)
    if lines["tolerance_mm"].notna().any():
        look = style.LIMIT | {"color": style.INK, "marker": "_"}
        ax.plot(lines["tolerance_mm"], label="tolerance", **look)
    ax.set(ylabel="Position error (mm)", ylim=(0.0, None))
    style.legend_above(ax, 3, "mean; dashed, with open marks: 99 %; crosses: largest")


def _moved(ax: Axes, lines: pd.DataFrame) -> None:
    """Movement since the calibration in force, marked by verdict, above what chance moves."""
    moved, chance = lines["moved_mm"], lines["chance_mm"].dropna()
    if len(chance):
        ax.plot(chance, "_", ms=7, mew=1.4, color=style.MUTED, label="what chance shows at most")
        ax.vlines(chance.index, 0.0, chance, color=style.FAINT, lw=3.0, zorder=0.6)
    ax.plot(moved.dropna(), color=style.MUTED, lw=0.6, zorder=1)
    heights = moved.fillna(0.0)
    for verdict, (colour, marker, label) in VERDICTS.items():
        if (rows := lines["verdict"] == verdict).any():
            ax.plot(heights[rows], marker, color=colour, label=label, clip_on=False, zorder=3)
    for day, joint in lines["joint"][lines["verdict"] == RECALIBRATE].dropna().items():
        side = -1 if day > lines.index.to_numpy().mean() else 1  # where there is room
        ax.text(day, heights[day], f"  joint {joint:.0f}  ", ha="left" if side > 0 else "right",
                va="bottom", color=style.VERMILION)  # fmt: skip
    ax.set(ylabel="Moved (mm rms)", ylim=(0.0, 1.15 * np.nanmax([*moved, *chance, 0.0]) or 1.0))
    style.legend_above(ax, 7)
