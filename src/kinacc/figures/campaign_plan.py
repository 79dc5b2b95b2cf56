"""What a budget brings: distance between the bounds, and how often the aim is reached."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from kinacc.figures import style


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
    share = "Share with a bound" if power is None else "Share that reach the aim"
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 3.0)
        left, right = figure.subplots(1, 2, sharex=True)
        for curve, (colour, marker) in zip(curves, cycle(style.SERIES), strict=False):
            low, middle, high = curve.width_mm.T
            high = np.where(np.isfinite(high), high, top)
            left.fill_between(curve.budget, low, high, where=np.isfinite(low), color=colour,
                              alpha=0.15, lw=0.5)  # fmt: skip
            middle = np.where(np.isfinite(middle), middle, np.nan)
            look = {"color": colour, "marker": marker, "ms": 3}
            left.plot(curve.budget, middle, label=style.literal(curve.name), **look)
            right.plot(curve.budget, curve.power, **look)
        if wanted_mm is not None:
            left.axhline(wanted_mm, **style.LIMIT, label=f"wanted ({wanted_mm:g} mm)")
        if power is not None:
            right.axhline(power, **style.LIMIT, label=f"wanted ({power:.0%})")
        if enough is not None:
            left.axvline(enough, color=style.MUTED, lw=0.8, ls=":")
            right.axvline(enough, color=style.MUTED, lw=0.8, ls=":", label=f"{enough} readings")
        left.set(ylim=(0.0, top), xlabel="Readings allowed", ylabel="Upper minus lower bound, mm")
        right.set(ylim=(0.0, 1.04), xlabel="Readings allowed", ylabel=share)
        title = "median, 5 to 95 % of campaigns; to the top where some state no bound"
        figure.legend(loc="outside lower center", ncols=4, title=title,
                      title_fontsize=style.SMALL_PT)  # fmt: skip
    return figure
