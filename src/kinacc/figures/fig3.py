"""Fig. 3: heat maps of the largest position and orientation error over radial slices."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from kinacc.errors import InputError, Problem
from kinacc.figures import style
from kinacc.figures.columns import floats, require
from kinacc.tables.columns import Columns

COLUMNS = (
    "slice_deg",
    "radius_mm",
    "height_mm",
    "position_max_mm",
    "orientation_max_mrad",
    "solutions",
    "wanted",
)
ROWS = (("position_max_mm", "Position", "mm"), ("orientation_max_mrad", "Orientation", "mrad"))
COLOURMAP = "viridis"
MIDDLE = "#21918c"  # of the colour map
UNREACHED: dict[str, Any] = {
    "facecolor": "#e2e2e2",
    "hatch": "//////",
    "edgecolor": "#9a9a9a",
    "linewidth": 0,
}
PARTLY: dict[str, Any] = {"marker": ".", "ms": 1.6, "mew": 0, "mfc": "white", "ls": ""}
RING: dict[str, Any] = {"marker": "o", "ms": 5.5, "mfc": "none", "ls": ""}
HEAD = "Map error, DH to VEC, in slices at these angles about the robot's first axis"
DEFAULT_CELL_MM = 25.0
MARGINS_IN = (1.6, 1.5)  # of all panels together: beside them, and above and below


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``accuracy_map``."""
    return draw(inputs["accuracy_map"], dataset=settings.get("dataset"))


def draw(accuracy_map: Columns, *, dataset: str | None = None) -> Figure:
    """Draw ``accuracy_map``: a column per slice, position above orientation.

    One colour scale per row; unreachable cells are hatched, and those reached in some but not all
    orientations and branches dotted; the largest value of each slice is ringed and stated.
    Raises InputError where a column is missing or there is no row.
    """
    require(accuracy_map, COLUMNS, "accuracy_map")
    slice_deg = floats(accuracy_map, "slice_deg")
    slices = np.unique(slice_deg)
    if not slices.size:
        raise InputError(Problem("accuracy_map", "the table has no row", "at least one"))
    radius, height = (np.round(floats(accuracy_map, c), 3) for c in ("radius_mm", "height_mm"))
    radii, heights = np.unique(radius), np.unique(height)
    edges = _edges(radii), _edges(heights)
    solutions, wanted = floats(accuracy_map, "solutions"), floats(accuracy_map, "wanted")
    partly = (solutions > 0) & (solutions < wanted)
    unreached = False
    wide = slices.size > 2
    width = style.DOUBLE_COLUMN_IN if wide else style.SINGLE_COLUMN_IN
    panel_w = (width - MARGINS_IN[0]) / slices.size
    ratio = float(np.ptp(edges[1]) / np.ptp(edges[0]))
    panel_h = min(max(panel_w, 0.5) * ratio, 3.2)
    margin = MARGINS_IN[1] + (0.17 if dataset else 0.0) + (0.0 if wide else 0.31)
    with style.house():
        figure = style.new_figure(width, 2 * panel_h + margin)
        panels = figure.subplots(2, slices.size, sharex=True, sharey=True, squeeze=False)
        for row, (column, words, unit) in enumerate(ROWS):
            values = floats(accuracy_map, column)
            norm = Normalize(*colour_range(values))
            for ax, angle in zip(panels[row], slices, strict=True):
                mine = slice_deg == angle
                grid = _grid(radii, heights, radius[mine], height[mine], values[mine])
                unreached |= bool(np.isnan(grid).any())
                mesh = _panel(ax, *edges, grid, norm)
                some = mine & partly
                ax.plot(radius[some], height[some], **PARTLY, rasterized=True)
                title = _largest(ax, radii, heights, grid, unit)
                ax.set_title(title if row else f"{angle:g}°\n{title}", fontsize=style.SMALL_PT)
            bar = figure.colorbar(
                mesh, ax=list(panels[row]), ticks=MaxNLocator(4), fraction=0.08 / slices.size
            )
            bar.set_label(f"{words}\nerror ({unit})")
            bar.outline.set_linewidth(0.4)
        panels[1, (slices.size - 1) // 2].set_xlabel("Radius (mm)")
        figure.supylabel("Height (mm)", fontsize=style.TEXT_PT)
        head = HEAD if wide else fill(HEAD, 40)
        name = style.shortened(dataset or "", int(15 * width))
        figure.suptitle("\n".join(filter(None, [name, head])), parse_math=False)
        _legend(figure, unreached, bool(partly.any()), wide)
    return figure


def _edges(levels: np.ndarray) -> np.ndarray:
    """Return cell edges half-way between grid values."""
    if levels.size == 1:
        return levels[0] + DEFAULT_CELL_MM * np.array([-0.5, 0.5])
    middle = (levels[1:] + levels[:-1]) / 2
    return np.concatenate([[2 * levels[0] - middle[0]], middle, [2 * levels[-1] - middle[-1]]])


def _grid(
    radii: np.ndarray,
    heights: np.ndarray,
    radius: np.ndarray,
    height: np.ndarray,
    values: np.ndarray,
) -> np.ndarray:
    """Return values as (heights, radii), NaN where the table has none."""
    grid = np.full((heights.size, radii.size), np.nan)
    grid[np.searchsorted(heights, height), np.searchsorted(radii, radius)] = values
    return grid


def colour_range(values: np.ndarray) -> tuple[float, float]:
    """Ends of a scale of colours: apart, even where all values are the same or there is none."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    return (low, high) if high - low > 1e-3 * abs(high) else (0.9 * low, 1.1 * high + 1e-3)


def _panel(ax: Axes, r_edges: np.ndarray, h_edges: np.ndarray, grid: np.ndarray, norm: Normalize):
    """Draw one slice; what is not drawn leaves the hatched background to be seen."""
    ax.patch.set(**UNREACHED)
    mesh = ax.pcolormesh(
        r_edges,
        h_edges,
        np.ma.masked_invalid(grid),
        norm=norm,
        cmap=COLOURMAP,
        rasterized=True,
        linewidth=0,
    )
    ax.grid(False)
    ax.spines[["top", "right"]].set_visible(True)
    ax.xaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 2.5, 5, 10]))
    return mesh


def _largest(ax: Axes, radii: np.ndarray, heights: np.ndarray, grid: np.ndarray, unit: str) -> str:
    """Ring the cell with the largest value; return it in words."""
    if not np.isfinite(grid).any():
        return "none reached"
    row, column = np.unravel_index(np.nanargmax(grid), grid.shape)
    at = radii[column], heights[row]
    ax.plot(*at, **RING, mec="white", mew=2.2, clip_on=False, zorder=5)
    ax.plot(*at, **RING, mec=style.INK, mew=0.9, clip_on=False, zorder=5)
    return f"max {grid[row, column]:.2f} {unit}"


def _legend(figure: Figure, unreached: bool, partly: bool, wide: bool) -> None:
    """Write below the panels what marks mean."""
    handles: list[Any] = [Line2D([], [], **RING, mec=style.INK, mew=0.9)]
    names = ["largest in the slice"]
    if unreached:
        handles.append(Patch(**UNREACHED))
        names.append("not reachable")
    if partly:
        dots = Line2D([0.25, 0.5, 0.75], [0.5] * 3, **PARTLY | {"ms": 3})
        handles.append((Patch(facecolor=MIDDLE), dots))
        names.append("some poses not reachable")
    figure.legend(handles, names, loc="outside lower center", ncols=3 if wide else 2)
