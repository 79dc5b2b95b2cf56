"""What a budget brings: distance between the bounds, and how often the aim is reached."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.figures import style

_STYLES = (
    (style.BLUE, "o"),
    (style.ORANGE, "s"),
    (style.GREEN, "^"),
    (style.PURPLE, "D"),
    (style.VERMILION, "v"),
    (style.SKY, "P"),
    (style.INK, "X"),
)
_POWER_TOP = 1.04


class Curve(NamedTuple):
    """One kind of errors: budgets (n,), quantiles 5, 50, 95 % of the width (n, 3), power (n,)."""

    name: str
    budget: np.ndarray
    width_mm: np.ndarray
    power: np.ndarray


def draw(
    curves: Sequence[Curve],
    wanted_mm: float | None,
    power: float | None,
    enough: int | None,
) -> Figure:
    """Draw width and power against budget; ``enough`` is the smallest budget that does."""
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 3.0)
        left, right = figure.subplots(1, 2, sharex=True)
        top = _top(curves, wanted_mm)
        for number, curve in enumerate(curves):
            colour, marker = _STYLES[number % len(_STYLES)]
            _band(left, curve, colour, top)
            middle = np.where(np.isfinite(curve.width_mm[:, 1]), curve.width_mm[:, 1], np.nan)
            left.plot(
                curve.budget,
                middle,
                color=colour,
                marker=marker,
                ms=3,
                label=style.literal(curve.name),
            )
            right.plot(curve.budget, curve.power, color=colour, marker=marker, ms=3)
        left.set_ylim(0.0, top)
        right.set_ylim(0.0, _POWER_TOP)
        if wanted_mm is not None:
            left.axhline(wanted_mm, color=style.VERMILION, lw=1.0, ls=(0, (6, 2)))
            style.outside_label(left, wanted_mm / top, "wanted", style.VERMILION)
        if power is not None:
            right.axhline(power, color=style.VERMILION, lw=1.0, ls=(0, (6, 2)))
            style.outside_label(right, power / _POWER_TOP, f"{power:.0%}\nwanted", style.VERMILION)
        if enough is not None:
            for ax in (left, right):
                ax.axvline(enough, color=style.MUTED, lw=0.8, ls=(0, (1, 1)))
            right.annotate(
                f"{enough} readings",
                (enough, 0.02),
                xytext=(3, 0),
                textcoords="offset points",
                fontsize=style.SMALL_PT,
            )
        left.set(xlabel="Readings allowed", ylabel="Upper minus lower bound, mm")
        title = "median, 5 to 95 % of campaigns; to the top where some state no bound"
        figure.legend(loc="outside lower center", ncols=min(len(curves), 4), title=title,
                      title_fontsize=style.SMALL_PT)  # fmt: skip
        right.set(xlabel="Readings allowed", ylabel="Share that reach the aim")
        if power is None:
            right.set_ylabel("Share with a bound")
    return figure


def _top(curves: Sequence[Curve], wanted_mm: float | None) -> float:
    """Height of the axis: all widths that are finite, and the one wanted."""
    widths = np.concatenate([curve.width_mm.ravel() for curve in curves])
    highest = max(widths[np.isfinite(widths)], default=0.0)
    return 1.08 * max(float(highest), wanted_mm or 0.0) or 1.0


def _band(ax: Axes, curve: Curve, colour: str, top: float) -> None:
    """From the narrow to the wide campaigns; to the top where more than 5 % state no bound."""
    low, _, high = curve.width_mm.T
    stated = np.isfinite(low)
    high = np.where(np.isfinite(high), high, top)
    ax.fill_between(curve.budget, low, high, where=stated, color=colour, alpha=0.15, lw=0)
    for edge in (low, high):
        ax.plot(curve.budget[stated], edge[stated], color=colour, lw=0.5, alpha=0.6)
