"""What a budget brings: distance between the bounds, and how often the aim is reached."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from kinacc.figures import style

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
    """Draw width and power against budget; ``enough`` is the smallest budget that does.

    Bands reach from the narrow to the wide campaigns; to the top where more than 5 % state no
    bound.
    """
    widths = np.concatenate([curve.width_mm.ravel() for curve in curves])
    top = 1.08 * max(widths[np.isfinite(widths)].max(initial=0.0), wanted_mm or 0.0) or 1.0
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 3.0)
        left, right = figure.subplots(1, 2, sharex=True)
        for number, curve in enumerate(curves):
            colour, marker = style.SERIES[number % len(style.SERIES)]
            look = {"color": colour, "marker": marker, "ms": 3}
            low, middle, high = curve.width_mm.T
            stated = np.isfinite(low)
            high = np.where(np.isfinite(high), high, top)
            left.fill_between(curve.budget, low, high, where=stated, color=colour, alpha=0.15, lw=0)
            for edge in (low, high):
                left.plot(curve.budget[stated], edge[stated], color=colour, lw=0.5, alpha=0.6)
            middle = np.where(np.isfinite(middle), middle, np.nan)
            left.plot(curve.budget, middle, label=style.literal(curve.name), **look)
            right.plot(curve.budget, curve.power, **look)
        left.set(ylim=(0.0, top), xlabel="Readings allowed", ylabel="Upper minus lower bound, mm")
        if wanted_mm is not None:
            left.axhline(wanted_mm, **style.LIMIT)
            style.outside_label(left, wanted_mm / top, "wanted", style.VERMILION)
        share = "Share with a bound" if power is None else "Share that reach the aim"
        right.set(ylim=(0.0, _POWER_TOP), xlabel="Readings allowed", ylabel=share)
        if power is not None:
            right.axhline(power, **style.LIMIT)
            style.outside_label(right, power / _POWER_TOP, f"{power:.0%}\nwanted", style.VERMILION)
        if enough is not None:
            for ax in (left, right):
                ax.axvline(enough, color=style.MUTED, lw=0.8, ls=(0, (1, 1)))
            right.annotate(f"{enough} readings", (enough, 0.02), xytext=(3, 0),
                           textcoords="offset points", fontsize=style.SMALL_PT)  # fmt: skip
        title = "median, 5 to 95 % of campaigns; to the top where some state no bound"
        figure.legend(loc="outside lower center", ncols=min(len(curves), 4), title=title,
                      title_fontsize=style.SMALL_PT)  # fmt: skip
    return figure
