"""A robot's history: errors, movement and temperature over the lines of its series."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure

from kinacc.figures import style
from kinacc.tables.allowed import FIRST, HOLDS, OPEN, RECALIBRATE

# Statistic, line style and width, marker and face; the largest errors are marks without a line.
_STATISTICS = (
    ("mean", "-", 1.3, "", ""),
    ("quantile_99", (0, (4, 1.5)), 1.0, "", "white"),
    ("largest", "none", 0.0, "x", "white"),
)
_CALIBRATIONS = (
    ("held_out", style.BLUE, "o", "calibrated on this line, held out"),
    ("in_force", style.ORANGE, "^", "calibration in force before"),
)
COLUMNS = (
    *("date", "verdict", "joint", "moved_mm", "chance_mm", "temperature_c", "tolerance_mm"),
    *(f"{which}_{name}_mm" for which, *_ in _CALIBRATIONS for name, *_ in _STATISTICS),
)
# Colour, marker, size and label of a verdict.
VERDICTS = {
    FIRST: (style.INK, "s", 4.0, "first calibration"),
    HOLDS: (style.GREEN, "o", 4.5, "holds"),
    RECALIBRATE: (style.VERMILION, "D", 5.0, "recalibrate"),
    OPEN: (style.MUTED, "X", 5.0, "cannot be told"),
}
_ROOM_DAYS = 20.0  # beside a history of one line
_LEAST_SPAN_C = 1.0  # either way: less is no change worth a look


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Of the table ``history`` of the data set."""
    return draw(inputs["history"], dataset=settings["dataset"])


def draw(history: Mapping, *, dataset: str | None = None) -> Figure:
    """Draw ``history``, one row a line by date.

    Above: position errors of the calibration made of each line at its held-out poses, and of the
    one in force before at the same line's poses; the tolerance. Below: what predictions moved since
    the calibration in force, beside what chance moves, marked by the verdict. Last the temperature,
    where it is stated. Raises InputError where a column is missing.
    """
    style.require(history, COLUMNS, "history")
    lines = pd.DataFrame({name: history[name] for name in COLUMNS})
    lines.index = pd.Index(lines["date"].to_numpy("datetime64[D]").astype(float))
    warm = lines["temperature_c"].dropna()
    heights = [1.25, 1.0, 0.4][: 3 if len(warm) else 2]
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 1.75 * sum(heights) + 0.3)
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
                panel.axvline(day, color=style.VERMILION, lw=0.7, ls=(0, (1, 1.5)), zorder=0.5)
            panel.grid(axis="x", visible=False)
        _dates(panels[-1], lines)
        style.name_dataset(figure, dataset)
    return figure


def _errors(ax: Axes, lines: pd.DataFrame) -> None:
    """Mean and 99 % as lines, the largest as marks, of both calibrations at each line's poses."""
    for which, colour, point, label in _CALIBRATIONS:
        for name, line, width, marker, face in _STATISTICS:
            values = lines[f"{which}_{name}_mm"].dropna()
            if len(values):
                ax.plot(
                    values, ls=line, lw=width, color=colour, marker=marker or point, ms=3.0,
                    mfc=face or colour, mew=0.8, label=None if face else label,
                )  # fmt: skip
    if lines["tolerance_mm"].notna().any():
        look = style.LIMIT | {"color": style.INK, "marker": "_"}
        ax.plot(lines["tolerance_mm"], label="tolerance", **look)
    top = lines[[*COLUMNS[7:], "tolerance_mm"]].max(axis=None)
    ax.set(ylabel="Position error (mm)", ylim=(0.0, 1.08 * top or 1.0))
    ax.locator_params(axis="y", nbins=6)
    style.legend_above(ax, 3, "mean; dashed, with open marks: 99 %; crosses: largest")


def _moved(ax: Axes, lines: pd.DataFrame) -> None:
    """Movement since the calibration in force, marked by verdict, above what chance moves."""
    moved, chance = lines["moved_mm"], lines["chance_mm"].dropna()
    if len(chance):
        ax.plot(
            chance, ls="none", marker="_", ms=7, mew=1.4, color=style.MUTED,
            label="what chance shows at most",
        )  # fmt: skip
        ax.vlines(chance.index, 0.0, chance, color=style.FAINT, lw=3.0, zorder=0.6)
    ax.plot(moved.dropna(), color=style.MUTED, lw=0.6, zorder=1)
    at = moved.fillna(0.0)
    for name, (colour, marker, size, label) in VERDICTS.items():
        own = at[lines["verdict"] == name]
        if len(own):
            ax.plot(
                own, ls="none", marker=marker, ms=size, color=colour,
                mec="white", mew=0.4, label=label, clip_on=False, zorder=3,
            )  # fmt: skip
    for day, joint in lines["joint"][lines["verdict"] == RECALIBRATE].dropna().items():
        is_late = day > lines.index.to_numpy().mean()  # words go to the side that has room
        ax.annotate(
            f"joint {joint:.0f}", (day, at[day]), (-5 if is_late else 5, 3),
            textcoords="offset points", ha="right" if is_late else "left", va="bottom",
            fontsize=style.SMALL_PT, color=style.darker(style.VERMILION),
        )  # fmt: skip
    highest = np.nanmax([*moved, *chance, 0.0])
    ax.set(ylabel="Moved (mm rms)", ylim=(0.0, 1.15 * highest or 1.0))
    style.legend_above(ax, 7, borderaxespad=0.1)


def _dates(ax: Axes, lines: pd.DataFrame) -> None:
    """Days as a reader writes them, with room at both ends."""
    room = max(0.03 * float(np.ptp(lines.index)), _ROOM_DAYS if len(lines) == 1 else 1.0)
    ax.set_xlim(lines.index.min() - room, lines.index.max() + room)
    locator = AutoDateLocator(minticks=3, maxticks=9)
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(ConciseDateFormatter(locator, show_offset=False))
    ax.set_xlabel(f"{lines['date'].iloc[0]} to {lines['date'].iloc[-1]}")
