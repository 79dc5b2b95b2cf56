"""Fig. 3: heat maps of the largest position and orientation error over radial slices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from kinacc.artifacts.columns import Columns
from kinacc.errors import InputError, Problem
from kinacc.figures import style
from kinacc.figures.columns import floats, require

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


@dataclass(frozen=True)
class Panels:
    """Sizes in inches: panels of equal scale side by side, a colour bar at the right."""

    columns: int
    panel_w: float
    panel_h: float
    name_h: float = 0.0
    left: float = 0.62
    right: float = 0.72
    gap: float = 0.1
    head: float = 0.56
    between: float = 0.3
    foot: float = 0.68

    @property
    def width(self) -> float:
        """Width of the figure."""
        return self.left + self.columns * (self.panel_w + self.gap) + self.right

    @property
    def height(self) -> float:
        """Height of the figure."""
        return self.name_h + self.head + 2 * self.panel_h + self.between + self.foot

    def box(self, row: int, column: int) -> tuple[float, float, float, float]:
        """Left, bottom, width and height of a panel in figure fractions.

        ``column`` equal to the number of columns is the place of the colour bar.
        """
        x = self.left + column * (self.panel_w + self.gap)
        y = self.foot + (1 - row) * (self.panel_h + self.between)
        w = self.panel_w if column < self.columns else 0.09
        return x / self.width, y / self.height, w / self.width, self.panel_h / self.height


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
    layout = _layout(slices.size, *edges, named=bool(dataset), wordy=bool(partly.any()))
    with style.house():
        figure = style.new_figure(layout.width, layout.height, arranged=False)
        for row, (column, words, unit) in enumerate(ROWS):
            values = floats(accuracy_map, column)
            norm = _norm(values)
            for place, angle in enumerate(slices):
                mine = slice_deg == angle
                grid = _grid(radii, heights, radius[mine], height[mine], values[mine])
                unreached |= bool(np.isnan(grid).any())
                ax = figure.add_axes(layout.box(row, place))
                mesh = _panel(ax, *edges, grid, norm)
                some = mine & partly
                ax.plot(radius[some], height[some], **PARTLY, rasterized=True)
                title = _largest(ax, radii, heights, grid, unit)
                ax.set_title(title if row else f"{angle:g}°\n{title}", fontsize=style.SMALL_PT)
                ax.tick_params(labelleft=place == 0, labelbottom=row == 1)
            bar = figure.colorbar(
                mesh, cax=figure.add_axes(layout.box(row, slices.size)), ticks=MaxNLocator(4)
            )
            bar.set_label(f"{words}\nerror ({unit})")
            bar.outline.set_linewidth(0.4)
        _words(figure, layout, unreached, bool(partly.any()), dataset)
    return figure


def _layout(
    count: int, r_edges: np.ndarray, h_edges: np.ndarray, named: bool, wordy: bool
) -> Panels:
    """Fit ``count`` panels into the column width, at the same scale in both directions.

    ``named`` leaves room for the data set's name, ``wordy`` for three entries in the legend.
    """
    wide = count > 2
    width = style.DOUBLE_COLUMN_IN if wide else style.SINGLE_COLUMN_IN
    free = width - Panels.left - Panels.right - count * Panels.gap
    ratio = float(np.ptp(h_edges) / np.ptp(r_edges))
    panel_w = min(max(free / count, 0.5), 3.2 / ratio)
    foot = Panels.foot + (0.0 if wide or not wordy else 0.17)
    head = Panels.head + (0.0 if wide else 0.14)
    name_h = 0.17 if named else 0.0
    return Panels(count, panel_w, panel_w * ratio, name_h=name_h, head=head, foot=foot)


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


def _norm(values: np.ndarray) -> Normalize:
    finite = values[np.isfinite(values)]
    if not finite.size:
        return Normalize(0, 1)
    low, high = float(finite.min()), float(finite.max())
    if high - low < 1e-3 * abs(high):
        low, high = 0.9 * low, 1.1 * high + 1e-3
    return Normalize(low, high)


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


def _words(
    figure: Figure, layout: Panels, unreached: bool, partly: bool, dataset: str | None
) -> None:
    """Write axis names, the legend and the data set's name into the margins."""
    left, right = layout.left / layout.width, 1 - (layout.right + layout.gap) / layout.width
    middle = (layout.foot + layout.panel_h + layout.between / 2) / layout.height
    figure.text(
        0.05 / layout.width, middle, "Height (mm)", rotation=90, va="center", ha="left",
        fontsize=style.TEXT_PT,
    )  # fmt: skip
    figure.text(
        (left + right) / 2,
        (layout.foot - 0.31) / layout.height,
        "Radius (mm)",
        ha="center",
        va="center",
        fontsize=style.TEXT_PT,
    )
    figure.text(
        0.5,
        1 - (layout.name_h + 0.03) / layout.height,
        HEAD if layout.columns > 2 else fill(HEAD, 40),
        ha="center",
        va="top",
        fontsize=style.TEXT_PT,
    )
    handles: list[Any] = [Line2D([], [], **RING, mec=style.INK, mew=0.9)]
    names = ["largest in the slice"]
    if unreached:
        handles.append(Patch(**UNREACHED))
        names.append("not reachable")
    if partly:
        handles.append(
            (Patch(facecolor=MIDDLE), Line2D([0.25, 0.5, 0.75], [0.5] * 3, **PARTLY | {"ms": 3}))
        )
        names.append("some poses not reachable")
    figure.legend(
        handles,
        names,
        loc="lower center",
        bbox_to_anchor=((left + right) / 2, 0.04 / layout.height),
        borderpad=0,
        ncols=3 if layout.columns > 2 else 2,
    )
    style.name_dataset(figure, dataset)
