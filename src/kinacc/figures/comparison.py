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


def draw(difference: Difference) -> Figure:
    """Draw changes of the parameters, and the share of poses that moved no more than a distance.

    Parameters
    ----------
    difference
        Comparison of two calibrations; lengths in mm.
    """
    parameters = difference.parameters
    rows = 0 if parameters is None else len(parameters)
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, max(2.6, 0.13 * rows + 0.9))
        axes = figure.subplots(1, 2 if rows else 1, squeeze=False)[0]
        if parameters is not None and rows:
            _parameters(axes[0], parameters)
        _shifts(axes[-1], difference)
        style.name_dataset(figure, "{1} against {0}".format(*difference.names))
    return figure


def _parameters(ax: Axes, parameters: pd.DataFrame) -> None:
    """Changes in standard deviations; a change without one stands in words on the middle line."""
    names = [name.partition(".") for name in parameters["name"]]
    labels = [f"{_SYMBOLS[name]}$_{{{joint[1:]}}}$" for joint, _, name in names]
    table = parameters.assign(place=range(len(parameters)))
    known, unknown = table[table["sigmas"].notna()], table[table["sigmas"].isna()]
    far = known["sigmas"].abs() > _FAR
    ax.axvspan(-_FAR, _FAR, color=style.FAINT, alpha=0.5, lw=0)
    colours = np.where(far, style.VERMILION, style.BLUE)
    ax.barh(known["place"], known["sigmas"], 0.62, color=colours)
    ax.plot(np.zeros(len(unknown)), unknown["place"], "x", color=style.MUTED)
    for row in unknown[unknown["difference"].abs() > ROUNDING].itertuples():
        ax.annotate(
            f"{row.difference:+.3g} {row.unit}", (0.0, row.place), xytext=(4, 0),
            textcoords="offset points", va="center", fontsize=style.SMALL_PT, color=style.MUTED,
        )  # fmt: skip
    limit = max(_FAR * 1.5, 1.1 * known["sigmas"].abs().max()) if len(known) else _FAR * 1.5
    ax.set(xlim=(-limit, limit), ylim=(len(table) - 0.4, -0.6))
    ax.set_xlabel("Change (standard deviations)\n×: without one; the change, if any, beside it")
    ax.set_yticks(table["place"], labels)
    ax.grid(visible=False, axis="y")


def _shifts(ax: Axes, difference: Difference) -> None:
    looks = ("moved_mm", style.ORANGE, "-"), ("arm_moved_mm", style.GREEN, (0, (4, 1.5)))
    for (name, colour, line), row in zip(looks, difference.shifts.itertuples(), strict=True):
        label = f"{row.frames}: rms {row.rms_mm:.3g} mm"
        ax.ecdf(difference.poses[name], color=colour, ls=line, label=label)
        ax.axvline(row.chance_mm, color=colour, lw=0.9, ls=":")
    ax.set(xlabel="Change of flange position (mm)", ylabel="Share of poses", ylim=(0.0, 1.02))
    ax.set_xlim(left=0.0)
    dotted = difference.shifts["chance_mm"].notna().any()
    ax.legend(
        title="dotted: rms expected by chance" if dotted else None, title_fontsize=style.SMALL_PT
    )
