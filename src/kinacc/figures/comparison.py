"""Two calibrations side by side: parameters in standard deviations, and how far poses moved."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.deployment.compare import ROUNDING, Difference
from kinacc.figures import style

_FAR = 3.0  # standard deviations
_SYMBOLS = {"theta_offset": "θ", "d": "d", "a": "a", "alpha": "α", "beta": "β"}
_HATCHED: dict[str, Any] = {"hatch": "////", "ec": "white", "lw": 0}


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
    """Changes in standard deviations; in mm and mrad where none has a standard deviation."""
    places, sigmas = np.arange(len(parameters)), parameters["sigmas"].to_numpy()
    change = parameters["difference"].to_numpy()
    change = np.where(np.abs(change) > ROUNDING, change, 0.0)
    known = np.isfinite(sigmas)
    if known.any():
        far = known & (np.abs(sigmas) > _FAR)
        crossed, label = (
            ~known,
            "standard deviations)\n×: without one; the change, if any, beside it",
        )
        limit = max(_FAR * 1.5, 1.1 * np.abs(sigmas[known]).max())
        ax.axvspan(-_FAR, _FAR, color=style.FAINT, alpha=0.5, lw=0)
        ax.barh(places[known & ~far], sigmas[known & ~far], 0.62, color=style.BLUE)
        ax.barh(places[far], sigmas[far], 0.62, color=style.VERMILION, **_HATCHED)
        # Without a standard deviation there is no place on this axis: the change stands beside it.
        for place in places[crossed & (change != 0.0)]:
            ax.annotate(
                f"{change[place]:+.3g} {parameters['unit'][place]}", (0.0, place), xytext=(4, 0),
                textcoords="offset points", va="center", fontsize=style.SMALL_PT,
                color=style.MUTED,
            )  # fmt: skip
        at = np.zeros(len(places))
    else:
        crossed = (parameters["undetermined"] != "").to_numpy()
        limit = 1.1 * float(np.max(np.abs(change), initial=0.0)) or 1.0
        looks = {"mm": {"color": style.BLUE}, "mrad": {"color": style.ORANGE, **_HATCHED}}
        looks = {unit: look for unit, look in looks.items() if unit in set(parameters["unit"])}
        for unit, look in looks.items():
            rows = (parameters["unit"] == unit).to_numpy()
            ax.barh(places[rows], change[rows], 0.62, label=unit, **look)
        label = f"{', '.join(looks)}{'; ×: undetermined' * bool(crossed.any())})"
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        at = change
    ax.plot(at[crossed], places[crossed], "x", color=style.MUTED, ms=4)
    ax.axvline(0.0, color=style.MUTED, lw=0.6)
    ax.set(xlim=(-limit, limit), xlabel=f"Change ({label}", ylim=(len(places) - 0.4, -0.6))
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
