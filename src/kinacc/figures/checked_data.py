"""The picture of a checked file: how much of the joints it covers, and what a quick fit leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from kinacc.figures import style

_SHARE_OF_JOINTS = 0.32  # of the picture's height
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
        figure = Figure(figsize=(style.DOUBLE_COLUMN_IN, 4.2), layout="constrained")
        ratio = [_SHARE_OF_JOINTS, 1.0 - _SHARE_OF_JOINTS]
        above, below = figure.subplots(2, 1, height_ratios=ratio)
        _joints(above, coverage)
        if not left_mm.size:
            below.text(0.5, 0.5, "the robot does not fit the file", ha="center", va="center")
            below.set_axis_off()
        else:
            _residuals(below, line, left_mm, limit_mm, suspects)
    return figure


def coverage(joints: Sequence[Mapping]) -> Figure:
    """Measured range of every joint within its limits; see ``draw``."""
    with style.house():
        figure = Figure(figsize=(style.DOUBLE_COLUMN_IN, 1.6), layout="constrained")
        _joints(figure.subplots(), joints)
    return figure


def _joints(axes, coverage: Sequence[Mapping]) -> None:
    for row in coverage:
        joint, span = row["joint"], row["most"] - row["least"]
        axes.barh(joint, 1.0, left=0.0, height=0.62, color=style.FAINT)
        low, high = ((row[end] - row["least"]) / span for end in ("low", "high"))
        axes.barh(joint, high - low, left=low, height=0.62, color=style.SKY)
        words = f"{row['low']:.0f} to {row['high']:.0f} {row['unit']}"
        axes.text(1.01, joint, words, va="center", fontsize=style.SMALL_PT)
    axes.set_yticks([row["joint"] for row in coverage])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.18)
    axes.set_xticks([0.0, 0.5, 1.0], ["lower limit", "middle", "upper limit"])
    axes.grid(visible=False)
    axes.set_ylabel("joint")


def _residuals(axes, line, left_mm, limit_mm: float, suspects: Mapping) -> None:
    step = max(len(line) // _DOTS, 1)
    floor = max(float(np.quantile(left_mm, 0.01)), 1e-6)
    shown = np.maximum(left_mm, 0.1 * floor)
    axes.plot(line[::step], shown[::step], ".", ms=2.5, color=style.MUTED, label="readings")
    for number, (kind, lines) in enumerate(suspects.items()):
        colour, marker = _KINDS[number % len(_KINDS)]
        rows = np.isin(line, np.fromiter(lines, dtype=np.int64))
        words = kind.replace("_", " ")
        axes.plot(
            line[rows], shown[rows], marker, ms=4.5, mfc="none", mec=colour, label=words, ls="none"
        )
    if np.isfinite(limit_mm):
        axes.axhline(limit_mm, color=style.INK, lw=0.8, ls="--", label="most to be expected")
    axes.set_yscale("log")
    axes.set_xlabel("line of the file")
    axes.set_ylabel("left by a quick fit (mm)")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
