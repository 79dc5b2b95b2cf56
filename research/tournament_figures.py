"""The tournament in pictures: one quantity, fields along x, a panel per noise, all assessors."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.assess.registry import ASSESSORS
from kinacc.figures import style

UM_PER_MM = 1000.0
_MARKERS = "<>hp8d"

# By quantity: column, words on the axis, targets in order of preference, the line to compare with.
QUANTITIES = {
    "bias": ("bias_mm", "Bias of the value (mm)", ("candidates",), 0.0),
    "rmse": ("rmse_mm", "RMS error of the value (mm)", ("candidates",), None),
    "coverage": ("upper_holds", "Upper bounds that hold", ("measured", "region"), 0.95),
    "width": ("excess_mm", "Upper bound above the truth (mm)", ("measured", "region"), None),
}


def draw(cells: pd.DataFrame, quantity: str, budget: int) -> Figure:
    """Draw one quantity of ``tournament_cells`` for one budget, campaigns as stated.

    ``quantity`` is a name of :data:`QUANTITIES`; an assessor without it is left out, one with
    several targets shows the first of those the quantity prefers. Of every field the smallest
    number of candidates is shown.
    """
    column, words, targets, level = QUANTITIES[quantity]
    own = cells[(cells["budget"] == budget) & (cells["setup"] == "plain")]
    own = own[(own["world"] == "stated") & own[column].notna() & own["target"].isin(targets)]
    own = own[own["candidates"] == own.groupby("field")["candidates"].transform("min")]
    place = own["target"].map(targets.index)
    own = own[place == place.groupby(own["assessor"]).transform("min")]
    fields, names = sorted(set(own["field"])), sorted(set(own["assessor"]))
    looks = {name: look for name, look in _looks().items() if name in names}
    levels = sorted(set(own["noise_mm"]))
    with style.new_figure(style.DOUBLE_COLUMN_IN, 3.1) as figure:
        axes = figure.subplots(1, len(levels), sharey=True, squeeze=False)[0]
        for ax, noise_mm in zip(axes, levels, strict=True):
            _panel(ax, own[own["noise_mm"] == noise_mm], column, fields, looks)
            ax.set_title(f"noise {noise_mm * UM_PER_MM:g} µm", fontsize=style.SMALL_PT)
            if level is not None:
                ax.axhline(level, color=style.INK, lw=0.8, ls=(0, (4, 2)), zorder=1)
        if quantity in ("rmse", "width"):
            axes[0].set_yscale("log")
        axes[0].set_ylabel(words)
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _looks() -> dict[str, tuple[str, str, str]]:
    """Label, colour and marker of every assessor.

    Where there are more names than spare colours, a colour comes again with another marker.
    """
    looks, used = {}, set()
    for name, (words, colour, marker) in style.assessor_style(sorted(ASSESSORS)).items():
        free = next((each for each in (marker, *_MARKERS) if each not in used), marker)
        used.add(free)
        looks[name] = (words, colour, free)
    return looks


def _panel(ax: Axes, cells: pd.DataFrame, column: str, fields: list[str], looks: dict) -> None:
    width = 0.7 / max(len(looks), 1)
    for index, (name, (words, colour, marker)) in enumerate(looks.items()):
        own = cells[cells["assessor"] == name]
        x = own["field"].map(fields.index) + (index - (len(looks) - 1) / 2) * width
        if column == "upper_holds":
            ax.vlines(x, own["upper_low"], own["upper_high"], color=colour, lw=0.6, alpha=0.6)
        ax.plot(x, own[column], marker, color=colour, ms=3.2, mec="white", mew=0.3, ls="",
                label=words)  # fmt: skip
    ax.set_xticks(range(len(fields)), [each.removesuffix("_0") for each in fields], rotation=90)
    ax.grid(axis="x", visible=False)
    for place in np.arange(len(fields) - 1) + 0.5:
        ax.axvline(place, color=style.FAINT, lw=0.4, zorder=0)
