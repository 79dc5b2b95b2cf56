"""The picture of a checked file: how much of the joints it covers, and what a quick fit leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.figures import style

_DOTS = 20000  # more readings than this are not drawn one by one
_KINDS = ((style.VERMILION, "^"), (style.BLUE, "s"), (style.GREEN, "D"), (style.PURPLE, "v"))


def draw(
    coverage: Sequence[Mapping],
    line: np.ndarray,
    left_mm: np.ndarray,
    limit_mm: float,
    suspects: Mapping[str, Sequence[int]],
) -> Figure:
    """Joint coverage against limits above, residuals against the line of the file below.

    ``coverage`` has joint, low, high, least, most and unit per joint; ``line`` (n,) and ``left_mm``
    (n,) of the readings, empty where nothing was fitted; ``suspects`` lines by kind.
    """
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 4.2)
        above, below = figure.subplots(2, 1, height_ratios=(1, 2))
        _joints(above, coverage)
        if left_mm.size:
            _residuals(below, line, left_mm, limit_mm, suspects)
        else:
            below.text(0.5, 0.5, "the robot does not fit the file", ha="center", va="center")
            below.set_axis_off()
    return figure


def coverage(joints: Sequence[Mapping]) -> Figure:
    """Measured range of every joint within its limits; see ``draw``."""
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 1.6)
        _joints(figure.subplots(), joints)
    return figure


def _joints(axes: Axes, coverage: Sequence[Mapping]) -> None:
    for row in coverage:
        low, high = np.interp([row["low"], row["high"]], [row["least"], row["most"]], [0.0, 1.0])
        axes.barh(row["joint"], 1.0, height=0.62, color=style.FAINT)
        axes.barh(row["joint"], high - low, left=low, height=0.62, color=style.SKY)
        label = f"{row['low']:.0f} to {row['high']:.0f} {row['unit']}"
        axes.text(1.01, row["joint"], label, va="center", fontsize=style.SMALL_PT)
    axes.set_yticks([row["joint"] for row in coverage])
    axes.invert_yaxis()
    axes.set(xlim=(0.0, 1.18), ylabel="joint")
    axes.set_xticks([0.0, 0.5, 1.0], ["lower limit", "middle", "upper limit"])
    axes.grid(visible=False)


def _residuals(
    axes: Axes, line: np.ndarray, left_mm: np.ndarray, limit_mm: float, suspects: Mapping
) -> None:
    step = max(len(line) // _DOTS, 1)
    shown = np.maximum(left_mm, max(0.1 * float(np.quantile(left_mm, 0.01)), 1e-7))
    axes.plot(line[::step], shown[::step], ".", ms=2.5, color=style.MUTED, label="readings")
    for (kind, lines), (colour, marker) in zip(suspects.items(), cycle(_KINDS), strict=False):
        rows = np.isin(line, [*lines])
        axes.plot(line[rows], shown[rows], marker, mfc="none", mec=colour,
                  label=kind.replace("_", " "))  # fmt: skip
    if np.isfinite(limit_mm):
        axes.axhline(limit_mm, color=style.INK, lw=0.8, ls="--", label="most to be expected")
    axes.set(yscale="log", xlabel="line of the file", ylabel="left by a quick fit (mm)")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
