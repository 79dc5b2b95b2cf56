"""Fig. 3: heat maps of the largest position and orientation error over radial slices."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from kinacc.figures import style
from kinacc.tables.columns import Columns

PLACE = ["slice_deg", "radius_mm", "height_mm"]
ROWS = (("position_max_mm", "Position", "mm"), ("orientation_max_mrad", "Orientation", "mrad"))
HEAD = "Map error, DH to VEC, in slices at these angles about the robot's first axis"
DEFAULT_CELL_MM = 25.0
RING, PARTLY = "largest in the slice", "some poses not reachable"
EVERYWHERE = "in every cell some poses are not reachable"
MARGINS_IN = (1.6, 1.7)  # of all panels together: beside them, and above and below
_HATCHED: dict[str, Any] = {
    "facecolor": "#e2e2e2",
    "hatch": "//////",
    "edgecolor": "#9a9a9a",
    "linewidth": 0,
}


def draw(accuracy_map: Columns, *, dataset: str | None = None) -> Figure:
    """Draw ``accuracy_map``: a column per slice, position above orientation.

    One colour scale per row; unreachable cells are hatched, and those reached in some but not all
    orientations and branches dotted, unless all are; the largest value of each slice is ringed and
    stated. The legend lists the marks that are there.
    """
    cells = pd.DataFrame(accuracy_map)
    cells[PLACE] = cells[PLACE].round(3)
    partly = (cells["solutions"] > 0) & (cells["solutions"] < cells["wanted"])
    cells["dotted"] = partly & ~partly.all()
    slices, radii, heights = (np.unique(cells[name]) for name in PLACE)
    edges = _edges(radii), _edges(heights)
    width = style.DOUBLE_COLUMN_IN
    panel_w = max((width - MARGINS_IN[0]) / slices.size, 0.5)
    panel_h = min(panel_w * float(np.ptp(edges[1]) / np.ptp(edges[0])), 3.2)
    with style.new_figure(width, 2 * panel_h + MARGINS_IN[1]) as figure:
        panels = figure.subplots(2, slices.size, sharex=True, sharey=True, squeeze=False)
        for row, (column, label, unit) in enumerate(ROWS):
            low, high = colour_range(cells[column].to_numpy())
            grids = cells.pivot(index=PLACE[::2], columns="radius_mm", values=column)
            for ax, angle in zip(panels[row], slices, strict=True):
                of_slice = cells[cells["slice_deg"] == angle]
                grid = np.ma.masked_invalid(grids.loc[angle])
                mesh = ax.pcolormesh(*edges, grid, vmin=low, vmax=high, rasterized=True)
                title = _marks(ax, of_slice, column, unit)
                ax.set_title(title if row else f"{angle:g}°\n{title}", loc="center")
            bar = figure.colorbar(
                mesh, ax=[*panels[row]], ticks=MaxNLocator(4), fraction=0.08 / slices.size
            )
            bar.set_label(f"{label}\nerror ({unit})")
        for ax in panels.flat:
            ax.patch.set(**_HATCHED)
            ax.locator_params(nbins=3)
            ax.grid(False)
        panels[1, (slices.size - 1) // 2].set_xlabel("Radius (mm)")
        figure.supylabel("Height (mm)")
        name = style.shortened(dataset or "", int(15 * width))
        figure.suptitle(f"{name}\n{HEAD}".strip(), parse_math=False)
        rings = [line for ax in panels.flat for line in ax.lines if line.get_label() == RING]
        marks: dict[str, Artist] = {RING: rings[-1]} if rings else {}
        if partly.all():
            marks[EVERYWHERE] = Patch(fc="none")
        elif partly.any():
            marks[PARTLY] = Patch(fc="#21918c", ec="white", hatch="...", lw=0)
        if (cells["solutions"] > 0).sum() < slices.size * radii.size * heights.size:
            marks["not reachable"] = Patch(**_HATCHED)
        figure.legend(marks.values(), marks, loc="outside lower center", ncols=3)
    return figure


def _edges(levels: np.ndarray) -> np.ndarray:
    """Edges of cells about grid values."""
    half = 0.5 * cell_size(levels)
    return np.append(levels - half, levels[-1] + half)


def cell_size(levels: np.ndarray) -> float:
    """Distance of neighbouring grid values in mm; that of a usual map for a single one."""
    return float(np.diff(levels).min()) if levels.size > 1 else DEFAULT_CELL_MM


def colour_range(values: np.ndarray) -> tuple[float, float]:
    """Ends of a scale of colours: apart, even where all values are the same or there is none."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    return (low, high) if high - low > 1e-3 * abs(high) else (0.9 * low, 1.1 * high + 1e-3)


def _marks(ax: Axes, cells: pd.DataFrame, column: str, unit: str) -> str:
    """Dot cells that are partly reached, ring the largest value; return it in words."""
    dotted = cells[cells["dotted"]]
    ax.plot(dotted["radius_mm"], dotted["height_mm"], ".", ms=1.6, mew=0, color="white",
            rasterized=True, label=PARTLY)  # fmt: skip
    if cells[column].isna().all():
        return "none reached"
    worst = cells.loc[cells[column].idxmax()]
    for colour, line in (("white", 2.2), (style.INK, 0.9)):
        ax.plot(worst["radius_mm"], worst["height_mm"], "o", ms=5.5, mfc="none", mec=colour,
                mew=line, clip_on=False, label=RING)  # fmt: skip
    return f"max {worst[column]:.2f} {unit}"
