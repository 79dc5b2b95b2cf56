"""Readings repeated at one pose, and the distances between targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.checks.cells import Cells

_MEDIAN_1D = 0.6744897501960817  # median of |x| of a standard normal number


@dataclass(frozen=True)
class Repeats:
    """Readings taken at one pose.

    ``groups``: poses and targets with more than one reading; ``deviation_mm`` (n, 3) of every
    reading from the median of the others there, NaN where it is alone; ``common``: correlation of
    the deviations of different targets, NaN for one target.
    """

    groups: int
    deviation_mm: np.ndarray
    common: float


def repeats(cells: Cells, cell: np.ndarray) -> Repeats:
    """Readings that share a cell (n,), one per pose and target."""
    deviation = np.full(cells.position_mm.shape, np.nan)
    centred = np.full(cells.position_mm.shape, np.nan)
    counts = np.bincount(cell)
    order = np.argsort(cell, kind="stable")
    ends = np.cumsum(counts)
    for number in np.flatnonzero(counts > 1):
        rows = order[ends[number] - counts[number] : ends[number]]
        points = cells.position_mm[rows]
        centred[rows] = points - points.mean(axis=0)
        for place, row in enumerate(rows):
            deviation[row] = points[place] - np.median(np.delete(points, place, axis=0), axis=0)
    return Repeats(int(np.sum(counts > 1)), deviation, _common(cells, centred))


def _common(cells: Cells, centred: np.ndarray) -> float:
    """Correlation between the deviations of two targets of one row."""
    if len(cells.target_names) < 2:
        return np.nan
    sides = _side_by_side(cells, centred)
    found = []
    for one in range(sides.shape[1]):
        for other in range(one + 1, sides.shape[1]):
            both = np.isfinite(sides[:, one, 0]) & np.isfinite(sides[:, other, 0])
            if both.sum() > 3:
                a, b = sides[both, one].ravel(), sides[both, other].ravel()
                scale = np.sqrt(np.sum(a**2) * np.sum(b**2))
                found.append(float(np.sum(a * b) / scale) if scale > 0 else np.nan)
    return float(np.mean(found)) if found else np.nan


def _side_by_side(cells: Cells, values: np.ndarray) -> np.ndarray:
    """Values (readings, targets, 3) of the targets of one session, pose and repeat."""
    label = np.column_stack([cells.session, cells.pose, cells.repeat])
    number = np.unique(label, axis=0, return_inverse=True)[1].ravel()
    sides = np.full((number.max() + 1, len(cells.target_names), 3), np.nan)
    sides[number, cells.target] = values
    return sides


@dataclass(frozen=True)
class Distance:
    """Distance between targets ``one`` and ``other``, row by row.

    ``rows`` (m, 2) indices of the two readings, ``length_mm`` (m,) in the order of the file;
    ``middle_mm`` and robust ``std_mm`` over all of them.
    """

    one: int
    other: int
    rows: np.ndarray
    length_mm: np.ndarray
    middle_mm: float
    std_mm: float


def distances(cells: Cells) -> list[Distance]:
    """Distances of all pairs of targets that were seen together often enough to compare."""
    label = np.column_stack([cells.session, cells.pose, cells.repeat])
    number = np.unique(label, axis=0, return_inverse=True)[1].ravel()
    place = np.full((number.max() + 1, len(cells.target_names)), -1)
    place[number, cells.target] = np.arange(len(cells))
    found = []
    for one in range(place.shape[1]):
        for other in range(one + 1, place.shape[1]):
            rows = place[:, [one, other]]
            rows = rows[(rows >= 0).all(axis=1)]
            if len(rows) < 3:
                continue
            rows = rows[np.argsort(cells.line[rows[:, 0]], kind="stable")]
            ends = cells.position_mm[rows]
            length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
            middle = float(np.median(length))
            std = float(np.median(np.abs(length - middle))) / _MEDIAN_1D
            found.append(Distance(one, other, rows, length, middle, std))
    return found
