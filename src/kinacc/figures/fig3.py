"""Fig. 3: heat maps of the largest position and orientation error over radial slices."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from kinacc.errors import InputError, Problem
from kinacc.figures import style

PLACE = ("slice_deg", "radius_mm", "height_mm")
ROWS = (("position_max_mm", "Position", "mm"), ("orientation_max_mrad", "Orientation", "mrad"))
COLUMNS = (*PLACE, *(name for name, _, _ in ROWS), "solutions", "wanted")
MIDDLE = "#21918c"  # of the colour map
UNREACHED: dict[str, Any] = {
    "facecolor": "#e2e2e2", "hatch": "//////", "edgecolor": "#9a9a9a", "linewidth": 0,
}  # fmt: skip
PARTLY: dict[str, Any] = {"marker": ".", "ms": 1.6, "mew": 0, "mfc": "white", "ls": ""}
RING: dict[str, Any] = {"marker": "o", "ms": 5.5, "mfc": "none", "ls": ""}
HEAD = "Map error, DH to VEC, in slices at these angles about the robot's first axis"
DEFAULT_CELL_MM = 25.0
MARGINS_IN = (1.6, 1.5)  # of all panels together: beside them, and above and below


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``accuracy_map``."""
    return draw(inputs["accuracy_map"], dataset=settings.get("dataset"))


def draw(accuracy_map: Mapping, *, dataset: str | None = None) -> Figure:
    """Draw ``accuracy_map``: a column per slice, position above orientation.

    One colour scale per row; unreachable cells are hatched, and those reached in some but not all
    orientations and branches dotted; the largest value of each slice is ringed and stated.
    Raises InputError where a column is missing or there is no row.
    """
    style.require(accuracy_map, COLUMNS, "accuracy_map")
    cells = pd.DataFrame({name: accuracy_map[name] for name in COLUMNS}).round(
        dict.fromkeys(PLACE[1:], 3)
    )
    if cells.empty:
        raise InputError(Problem("accuracy_map", "the table has no row", "at least one"))
    radii, heights = (np.unique(cells[name]) for name in PLACE[1:])
    edges = _edges(radii), _edges(heights)
    partly = cells[(cells["solutions"] > 0) & (cells["solutions"] < cells["wanted"])]
    slices = np.unique(cells["slice_deg"])
    wide = slices.size > 2
    width = style.DOUBLE_COLUMN_IN if wide else style.SINGLE_COLUMN_IN
    panel_w = max((width - MARGINS_IN[0]) / slices.size, 0.5)
    panel_h = min(panel_w * float(np.ptp(edges[1]) / np.ptp(edges[0])), 3.2)
    margin = MARGINS_IN[1] + 0.17 * bool(dataset) + 0.31 * (not wide)
    with style.house():
        figure = style.new_figure(width, 2 * panel_h + margin)
        panels = figure.subplots(2, slices.size, sharex=True, sharey=True, squeeze=False)
        for row, (column, label, unit) in enumerate(ROWS):
            norm = Normalize(*colour_range(cells[column].to_numpy()))
            for ax, angle in zip(panels[row], slices, strict=True):
                own = cells[cells["slice_deg"] == angle]
                grid = own.pivot(index="height_mm", columns="radius_mm", values=column)
                grid = grid.reindex(index=heights, columns=radii).to_numpy(float)
                mesh = _panel(ax, edges, grid, norm)
                dots = partly[partly["slice_deg"] == angle]
                ax.plot(dots["radius_mm"], dots["height_mm"], **PARTLY, rasterized=True)
                title = _largest(ax, radii, heights, grid, unit)
                ax.set_title(title if row else f"{angle:g}°\n{title}", fontsize=style.SMALL_PT)
            bar = figure.colorbar(
                mesh, ax=list(panels[row]), ticks=MaxNLocator(4), fraction=0.08 / slices.size
            )
            bar.set_label(f"{label}\nerror ({unit})")
            bar.outline.set_linewidth(0.4)
        panels[1, (slices.size - 1) // 2].set_xlabel("Radius (mm)")
        figure.supylabel("Height (mm)", fontsize=style.TEXT_PT)
        head = HEAD if wide else fill(HEAD, 40)
        name = style.shortened(dataset or "", int(15 * width))
        figure.suptitle(f"{name}\n{head}" if name else head, parse_math=False)
        unreached = len(cells) < slices.size * radii.size * heights.size
        unreached |= bool(cells[[column for column, _, _ in ROWS]].isna().any(axis=None))
        _legend(figure, unreached, not partly.empty, wide)
    return figure


def _edges(levels: np.ndarray) -> np.ndarray:
    """Return cell edges half-way between grid values."""
    if levels.size == 1:
        return levels[0] + DEFAULT_CELL_MM * np.array([-0.5, 0.5])
    middle = (levels[1:] + levels[:-1]) / 2
    return np.concatenate([[2 * levels[0] - middle[0]], middle, [2 * levels[-1] - middle[-1]]])


def colour_range(values: np.ndarray) -> tuple[float, float]:
    """Ends of a scale of colours: apart, even where all values are the same or there is none."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    return (low, high) if high - low > 1e-3 * abs(high) else (0.9 * low, 1.1 * high + 1e-3)


def _panel(ax: Axes, edges: tuple[np.ndarray, np.ndarray], grid: np.ndarray, norm: Normalize):
    """Draw one slice; the hatched background shows where there is no value."""
    ax.patch.set(**UNREACHED)
    ax.grid(False)
    ax.spines[["top", "right"]].set_visible(True)
    ax.xaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 2.5, 5, 10]))
    values = np.ma.masked_invalid(grid)
    return ax.pcolormesh(*edges, values, norm=norm, cmap="viridis", rasterized=True, linewidth=0)


def _largest(ax: Axes, radii: np.ndarray, heights: np.ndarray, grid: np.ndarray, unit: str) -> str:
    """Ring the cell with the largest value; return it in words."""
    if not np.isfinite(grid).any():
        return "none reached"
    row, column = np.unravel_index(np.nanargmax(grid), grid.shape)
    for colour, line in (("white", 2.2), (style.INK, 0.9)):
        ax.plot(radii[column], heights[row], **RING, mec=colour, mew=line, clip_on=False, zorder=5)
    return f"max {grid[row, column]:.2f} {unit}"


def _legend(figure: Figure, unreached: bool, partly: bool, wide: bool) -> None:
    """Explain the marks below the panels."""
    dots = Line2D([0.25, 0.5, 0.75], [0.5] * 3, **PARTLY | {"ms": 3})
    shown: list[tuple[bool, Any, str]] = [
        (True, Line2D([], [], **RING, mec=style.INK, mew=0.9), "largest in the slice"),
        (unreached, Patch(**UNREACHED), "not reachable"),
        (partly, (Patch(facecolor=MIDDLE), dots), "some poses not reachable"),
    ]
    handles, names = zip(*[each[1:] for each in shown if each[0]], strict=True)
    figure.legend(handles, names, loc="outside lower center", ncols=3 if wide else 2)
