"""What a budget brings: distance between the bounds, and how often the aim is reached."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
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
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 2.7)
        left, right = figure.subplots(1, 2, sharex=True)
        for number, curve in enumerate(curves):
            colour, marker = _STYLES[number % len(_STYLES)]
            low, middle, high = np.where(np.isfinite(curve.width_mm), curve.width_mm, np.nan).T
            left.fill_between(curve.budget, low, high, color=colour, alpha=0.15, lw=0)
            left.plot(curve.budget, middle, color=colour, marker=marker, ms=3, label=curve.name)
            right.plot(curve.budget, curve.power, color=colour, marker=marker, ms=3)
        if wanted_mm is not None:
            left.axhline(wanted_mm, color=style.VERMILION, lw=1.0, ls=(0, (6, 2)))
        if power is not None:
            right.axhline(power, color=style.VERMILION, lw=1.0, ls=(0, (6, 2)))
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
        left.set_title("median, 5 to 95 %", fontsize=style.SMALL_PT, loc="left")
        left.set_ylim(bottom=0.0)
        left.legend(loc="best")
        right.set(xlabel="Readings allowed", ylabel="Share of campaigns that reach the aim")
        if power is None:
            right.set_ylabel("Share of campaigns with a bound")
        right.set_ylim(0.0, 1.04)
    return figure
