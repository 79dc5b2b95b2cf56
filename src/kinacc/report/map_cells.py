"""Cells of the accuracy map as they are drawn: neighbours as one where there are too many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.tables.columns import Columns

MOST_CELLS = 6_000  # drawn one by one
_ALONE_MM = 25.0  # width of a cell that has no neighbour


@dataclass(frozen=True)
class Cells:
    """Cells that are drawn (n,), each of one or several rows of the table.

    ``of_row`` (rows,) says in which cell a row of the table is; ``farthest`` and ``most_turned``
    (n,) are the rows of the largest position and orientation error of a cell; ``reached`` is the
    share of its poses that are, ``wide_mm`` and ``high_mm`` its size.
    """

    slice_deg: np.ndarray
    radius_mm: np.ndarray
    height_mm: np.ndarray
    reached: np.ndarray
    of_row: np.ndarray
    farthest: np.ndarray
    most_turned: np.ndarray
    wide_mm: np.ndarray
    high_mm: np.ndarray

    @property
    def merged(self) -> bool:
        """Whether some cell stands for several of the table."""
        return len(self.of_row) > len(self.reached)


def cells(table: Columns, most: int = MOST_CELLS) -> Cells:
    """The cells of ``accuracy_map``, neighbours as one where there are more than ``most``."""
    slices, of_slice = np.unique(np.asarray(table["slice_deg"]), return_inverse=True)
    radii, across = _levels(table["radius_mm"])
    heights, up = _levels(table["height_mm"])
    of_row = _blocks(of_slice, across, up, 1)
    several = 1
    while of_row.max() >= most:
        several += 1
        of_row = _blocks(of_slice, across, up, several)
    tried, reached, radius, height = (
        np.bincount(of_row, np.asarray(table[name], dtype=float))
        for name in ("wanted", "solutions", "radius_mm", "height_mm")
    )
    farthest = largest_of(table["position_max_mm"], of_row)
    rows = np.bincount(of_row)
    return Cells(
        slices[of_slice[farthest]],
        radius / rows,
        height / rows,
        reached / tried,
        of_row,
        farthest,
        largest_of(table["orientation_max_mrad"], of_row),
        _widths(radii, several)[across[farthest] // several],
        _widths(heights, several)[up[farthest] // several],
    )


def _levels(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values of the grid, and the number (n,) of that of every row."""
    return np.unique(np.round(np.asarray(values, dtype=float), 3), return_inverse=True)


def _blocks(of_slice: np.ndarray, across: np.ndarray, up: np.ndarray, size: int) -> np.ndarray:
    """In which block of ``size`` by ``size`` cells of its slice each cell is; counted from 0."""
    places = np.stack([of_slice, across // size, up // size])
    return np.unique(places, axis=1, return_inverse=True)[1].ravel()


def largest_of(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """The row of the largest value of every group, the last of equals; any where none has one."""
    known = np.where(np.isnan(values), -np.inf, values)
    order = np.lexsort((known, group))
    last = np.append(np.diff(group[order]) > 0, True)
    return order[last]


def _widths(levels: np.ndarray, several: int) -> np.ndarray:
    """Width of every block of ``several`` levels of the grid, the last of what is left."""
    step = float(np.diff(levels).min()) if len(levels) > 1 else _ALONE_MM
    return step * np.bincount(np.arange(len(levels)) // several)
