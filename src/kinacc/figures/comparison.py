"""Two calibrations side by side: parameters in standard deviations, and how far poses moved."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.deployment.compare import ROUNDING, Difference
from kinacc.figures import style

_FAR = 3.0  # standard deviations
_SYMBOLS = {"theta_offset": "θ", "d": "d", "a": "a", "alpha": "α", "beta": "β"}


def draw(found: Difference) -> Figure:
    """Draw a comparison."""
    parameters = found.parameters
    rows = 0 if parameters is None else len(parameters)
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, max(2.6, 0.13 * rows + 0.9))
        if parameters is not None and rows:
            left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
            _parameters(left, parameters)
        else:
            right = figure.subplots()
        _shifts(right, found)
        style.name_dataset(figure, "{1} against {0}".format(*found.names))
    return figure


def _parameters(ax: Axes, parameters: pd.DataFrame) -> None:
    """Changes in standard deviations; a change without one stands in words on the middle line."""
    places, sigmas = np.arange(len(parameters)), parameters["sigmas"].to_numpy()
    known = np.isfinite(sigmas)
    far = np.abs(sigmas) > _FAR
    limit = max(_FAR * 1.5, 1.1 * np.abs(sigmas[known]).max(initial=0.0))
    ax.axvspan(-_FAR, _FAR, color=style.FAINT, alpha=0.5, lw=0)
    ax.barh(places[known & ~far], sigmas[known & ~far], 0.62, color=style.BLUE)
    ax.barh(places[far], sigmas[far], 0.62, color=style.VERMILION, hatch="////", ec="white", lw=0)
    for place, row in zip(places, parameters.itertuples(), strict=True):
        if not known[place] and abs(row.difference) > ROUNDING:
            ax.annotate(
                f"{row.difference:+.3g} {row.unit}", (0.0, place), xytext=(4, 0),
                textcoords="offset points", va="center", fontsize=style.SMALL_PT,
                color=style.MUTED,
            )  # fmt: skip
    ax.plot(np.zeros(sum(~known)), places[~known], "x", color=style.MUTED, ms=4)
    ax.axvline(0.0, color=style.MUTED, lw=0.6)
    ax.set(xlim=(-limit, limit), ylim=(len(places) - 0.4, -0.6))
    ax.set_xlabel("Change (standard deviations)\n×: without one; the change, if any, beside it")
    names = [name.partition(".") for name in parameters["name"]]
    ax.set_yticks(places, [f"{_SYMBOLS[name]}$_{{{joint[1:]}}}$" for joint, _, name in names])
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")


def _shifts(ax: Axes, found: Difference) -> None:
    looks = ("moved_mm", style.ORANGE, "-"), ("arm_moved_mm", style.GREEN, (0, (4, 1.5)))
    for (name, colour, line), row in zip(looks, found.shifts.itertuples(), strict=True):
        ordered = np.sort(found.poses[name])
        share = np.arange(1, len(ordered) + 1) / len(ordered)
        ax.plot(
            ordered, share, color=colour, ls=line, label=f"{row.frames}: rms {row.rms_mm:.3g} mm"
        )
        ax.axvline(row.chance_mm, color=colour, lw=0.9, ls=(0, (1, 1.5)))
    ax.set(xlabel="Change of flange position (mm)", ylabel="Share of poses", ylim=(0.0, 1.02))
    ax.set_xlim(left=0.0)
    dotted = found.shifts["chance_mm"].notna().any()
    ax.legend(
        loc="best",
        title="dotted: rms expected by chance" if dotted else None,
        title_fontsize=style.SMALL_PT,
    )
