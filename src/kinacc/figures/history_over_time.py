"""A robot's history: errors, movement and temperature over the lines of its series."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure

from kinacc.figures import style
from kinacc.figures.columns import floats, require, texts
from kinacc.tables.allowed import FIRST, HOLDS, OPEN, RECALIBRATE
from kinacc.tables.columns import Columns

COLUMNS = (
    *("date", "verdict", "joint", "moved_mm", "chance_mm", "temperature_c", "tolerance_mm"),
    *(f"{whose}_{each}_mm" for whose in ("held_out", "in_force") for each in ("mean", "largest")),
    *(f"{whose}_quantile_99_mm" for whose in ("held_out", "in_force")),
)
# Colour, marker and size of what was said of the calibration in force.
VERDICTS = {
    FIRST: (style.INK, "s", 4.0, "first calibration"),
    HOLDS: (style.GREEN, "o", 4.5, "holds"),
    RECALIBRATE: (style.VERMILION, "D", 5.0, "recalibrate"),
    OPEN: (style.MUTED, "X", 5.0, "cannot be told"),
}
_STATISTICS = (("mean", "-", 1.3), ("quantile_99", (0, (4, 1.5)), 1.0), ("largest", "", 0.0))
_MANY = 24  # lines: markers get smaller
_ROOM_DAYS = 20.0  # beside a history of one line
_LEAST_SPAN_C = 1.0  # either way: less is no change worth a look
_DAYS_APART = 0.14  # of the history, where every day has room for its own label


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Of the table ``history`` of the data set."""
    return draw(inputs["history"], dataset=settings["dataset"])


def draw(history: Columns, *, dataset: str | None = None) -> Figure:
    """Draw ``history``, one row a line by date.

    Above: position errors of the calibration made of each line at its held-out poses, and of the
    one in force before at the same line's poses; the tolerance. Below: what predictions moved since
    the calibration in force, beside what chance moves, marked by the verdict. Last the temperature,
    where it is stated. Raises InputError where a column is missing.
    """
    require(history, COLUMNS, "history")
    date = np.array(texts(history, "date"), dtype="datetime64[D]").astype(float)
    verdicts = texts(history, "verdict")
    warm = floats(history, "temperature_c")
    heights = [1.25, 1.0, 0.4] if np.isfinite(warm).any() else [1.25, 1.0]
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 1.75 * sum(heights) + 0.3)
        panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
        _errors(panels[0], history, date)
        _moved(panels[1], history, date, verdicts)
        if len(panels) == 3:
            size = 3.0 if len(date) <= _MANY else 1.5
            panels[2].plot(date, warm, "o-", color=style.PURPLE, ms=size, lw=0.9)
            panels[2].set_ylabel("°C")
            middle = 0.5 * (np.nanmin(warm) + np.nanmax(warm))
            half = max(0.6 * float(np.ptp(warm[np.isfinite(warm)])), _LEAST_SPAN_C)
            panels[2].set_ylim(middle - half, middle + half)
        for panel in panels:
            for day in date[verdicts == RECALIBRATE]:
                panel.axvline(day, color=style.VERMILION, lw=0.7, ls=(0, (1, 1.5)), zorder=0.5)
            panel.grid(axis="x", visible=False)
        _dates(panels[-1], date)
        style.name_dataset(figure, dataset)
    return figure


def _errors(ax: Axes, history: Columns, date: np.ndarray) -> None:
    """Mean and 99 % as lines, the largest as marks, of both calibrations at each line's poses."""
    looks = (
        ("held_out", style.BLUE, "ox", "calibrated on this line, held out"),
        ("in_force", style.ORANGE, "^x", "calibration in force before"),
    )
    size = 3.5 if len(date) <= _MANY else 1.8
    highest = 0.0
    for whose, colour, markers, words in looks:
        for name, line, width in _STATISTICS:
            values = floats(history, f"{whose}_{name}_mm")
            there = np.isfinite(values)
            if not there.any():
                continue
            highest = max(highest, float(values[there].max()))
            ax.plot(
                date[there], values[there], ls=line or "none", lw=width, color=colour,
                marker=markers[not line], ms=size if line else size + 0.5,
                mfc=colour if name == "mean" else "white", mew=0.8,
                label=words if name == "mean" else None,
            )  # fmt: skip
    limits = floats(history, "tolerance_mm")
    if np.isfinite(limits).any():
        ax.step(
            date, limits, where="mid", color=style.INK, lw=1.0, ls=(0, (6, 2)), label="tolerance"
        )
        if len(date) == 1:
            ax.axhline(limits[0], color=style.INK, lw=1.0, ls=(0, (6, 2)))
        highest = max(highest, float(np.nanmax(limits)))
    ax.set_ylabel("Position error (mm)")
    ax.set_ylim(0.0, 1.08 * highest if highest > 0.0 else 1.0)
    ax.plot([], [], ls="-", marker="o", ms=3, color=style.MUTED, label="mean")
    ax.plot(
        [], [], ls=_STATISTICS[1][1], marker="o", ms=3, mfc="white", color=style.MUTED, label="99 %"
    )
    ax.plot([], [], ls="none", marker="x", ms=3.5, mew=0.8, color=style.MUTED, label="largest")
    _legend(ax)


def _moved(ax: Axes, history: Columns, date: np.ndarray, verdicts: np.ndarray) -> None:
    """Movement since the calibration in force, marked by verdict, above what chance moves."""
    moved, chance = floats(history, "moved_mm"), floats(history, "chance_mm")
    joint = floats(history, "joint")
    known = np.isfinite(chance)
    if known.any():
        ax.plot(
            date[known], chance[known], ls="none", marker="_", ms=11 if len(date) <= _MANY else 5,
            mew=1.4, color=style.MUTED, label="what chance shows at most",
        )  # fmt: skip
        ax.vlines(date[known], 0.0, chance[known], color=style.FAINT, lw=3.0, zorder=0.6)
    there = np.isfinite(moved)
    ax.plot(date[there], moved[there], color=style.MUTED, lw=0.6, zorder=1)
    at = np.where(there, moved, 0.0)
    shrunk = 1.0 if len(date) <= _MANY else 0.7
    for name, (colour, marker, size, words) in VERDICTS.items():
        mine = verdicts == name
        if mine.any():
            ax.plot(
                date[mine], at[mine], ls="none", marker=marker, ms=size * shrunk, color=colour,
                mec="white", mew=0.4, label=words, clip_on=False, zorder=3,
            )  # fmt: skip
    for row in np.flatnonzero((verdicts == RECALIBRATE) & np.isfinite(joint)):
        is_late = date[row] > date.mean()  # words go to the side that has room
        ax.annotate(
            f"joint {joint[row]:.0f}", (date[row], at[row]), (-5 if is_late else 5, 3),
            textcoords="offset points", ha="right" if is_late else "left", va="bottom",
            fontsize=style.SMALL_PT, color=style.darker(style.VERMILION),
        )  # fmt: skip
    ax.set_ylabel("Moved (mm rms)")
    highest = np.nanmax([*moved, *chance, 0.0])
    ax.set_ylim(0.0, 1.15 * highest if highest > 0.0 else 1.0)
    if not there.any():
        ax.set_yticks([0.0])
    _legend(ax)


def _legend(ax: Axes) -> None:
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=7, borderaxespad=0.1)


def _dates(ax: Axes, date: np.ndarray) -> None:
    """Days as a reader writes them, with room at both ends."""
    room = max(0.03 * float(np.ptp(date)), _ROOM_DAYS if len(date) == 1 else 1.0)
    ax.set_xlim(date.min() - room, date.max() + room)
    days = date.astype("datetime64[D]").astype(str)
    if len(date) == 1 or np.diff(date).min() > _DAYS_APART * np.ptp(date):
        ax.set_xticks(date, days)
        return
    locator = AutoDateLocator(minticks=3, maxticks=9)
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(ConciseDateFormatter(locator, show_offset=False))
    ax.set_xlabel(f"{days[0]} to {days[-1]}")
