"""The tournament in pictures: one quantity, fields along x, a panel per noise, all assessors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.artifacts.columns import Columns
from kinacc.errors import InputError, Problem
from kinacc.figures import style
from kinacc.figures.columns import floats, require, texts

COLUMNS = ("assessor", "target", "field", "candidates", "noise_mm", "budget")
UM_PER_MM = 1000.0
_MARKERS = "<>hp8d"

# By quantity: column, words on the axis, targets in order of preference, the line to compare with.
QUANTITIES = {
    "bias": ("bias_mm", "Bias of the value (mm)", ("candidates",), 0.0),
    "rmse": ("rmse_mm", "RMS error of the value (mm)", ("candidates",), None),
    "coverage": ("upper_holds", "Upper bounds that hold", ("measured", "region"), 0.95),
    "width": ("excess_mm", "Upper bound above the truth (mm)", ("measured", "region"), None),
}


def draw(
    cells: Columns, quantity: str, candidates: int, budget: int, known: Sequence[str] = ()
) -> Figure:
    """Draw one quantity of ``tournament_cells`` for one candidate count and budget.

    ``quantity`` is a name of :data:`QUANTITIES`; ``known`` names all assessors there are, so that
    each looks the same in every tournament. An assessor without the quantity is left out.
    Raises InputError where a column is missing or no row is left.
    """
    column, words, targets, level = QUANTITIES[quantity]
    require(cells, (*COLUMNS, column), "tournament_cells")
    chosen = _chosen(cells, column, targets, candidates, budget)
    if not chosen.any():
        what = f"no {quantity} for {candidates} candidates and a budget of {budget}"
        raise InputError(Problem("tournament_cells", what))
    names, fields = texts(cells, "assessor"), texts(cells, "field")
    noise = floats(cells, "noise_mm")
    levels = np.unique(noise[chosen])
    shown = sorted(set(fields[chosen]))
    taking_part = set(names[chosen])
    looks = {name: look for name, look in _looks({*names, *known}).items() if name in taking_part}
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 3.1)
        axes = figure.subplots(1, len(levels), sharey=True, squeeze=False)[0]
        for ax, each in zip(axes, levels, strict=True):
            mine = chosen & (noise == each)
            _panel(ax, cells, column, mine, shown, looks)
            ax.set_title(f"noise {each * UM_PER_MM:g} µm", fontsize=style.SMALL_PT)
            if level is not None:
                ax.axhline(level, color=style.INK, lw=0.8, ls=(0, (4, 2)), zorder=1)
        if quantity in ("rmse", "width"):
            axes[0].set_yscale("log")
        axes[0].set_ylabel(words)
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _looks(names: set[str]) -> dict[str, tuple[str, str, str]]:
    """Label, colour and marker of every name, the same in all pictures of the same names.

    Where there are more names than spare colours, a colour comes again with another marker.
    """
    looks, used = {}, set()
    for name, (words, colour, marker) in style.assessor_style(sorted(names)).items():
        free = next((each for each in (marker, *_MARKERS) if each not in used), marker)
        used.add(free)
        looks[name] = (words, colour, free)
    return looks


def _chosen(cells: Columns, column: str, targets, candidates: int, budget: int) -> np.ndarray:
    """Rows to show: of every assessor those about the first of the targets it has values for."""
    fits = (floats(cells, "candidates") <= candidates) & (floats(cells, "budget") == budget)
    # A field with fewer points than asked for takes part with all it has.
    fits &= _largest_of_its_field(cells, candidates)
    fits &= np.isfinite(floats(cells, column))
    names, about = texts(cells, "assessor"), texts(cells, "target")
    chosen = np.zeros(names.size, dtype=bool)
    for name in set(names):
        for target in targets:
            mine = fits & (names == name) & (about == target)
            if mine.any():
                chosen |= mine
                break
    return chosen


def _largest_of_its_field(cells: Columns, candidates: int) -> np.ndarray:
    fields, counts = texts(cells, "field"), floats(cells, "candidates")
    largest = {
        name: counts[(fields == name) & (counts <= candidates)].max(initial=-1)
        for name in set(fields)
    }
    return counts == np.array([largest[name] for name in fields])


def _panel(ax: Axes, cells: Columns, column: str, mine, shown: list[str], looks: dict) -> None:
    names, fields, values = texts(cells, "assessor"), texts(cells, "field"), floats(cells, column)
    width = 0.7 / max(len(looks), 1)
    for index, (name, (words, colour, marker)) in enumerate(looks.items()):
        own = mine & (names == name)
        x = np.array([shown.index(each) for each in fields[own]], dtype=float)
        x += (index - (len(looks) - 1) / 2) * width
        if column == "upper_holds":
            low, high = (floats(cells, name)[own] for name in ("upper_low", "upper_high"))
            ax.vlines(x, low, high, color=colour, lw=0.6, alpha=0.6)
        ax.plot(
            x, values[own], marker, color=colour, ms=3.2, mec="white", mew=0.3, ls="", label=words
        )
    ax.set_xticks(range(len(shown)), [each.removesuffix("_0") for each in shown], rotation=90)
    ax.grid(axis="x", visible=False)
    for place in range(len(shown) - 1):
        ax.axvline(place + 0.5, color=style.FAINT, lw=0.4, zorder=0)
