"""What repeats and the distances between targets say about the instrument's noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.checks.cells import Cells

_MEDIAN_1D = 0.6744897501960817  # median of |x| of a standard normal number


def per_axis_mm(std_mm: np.ndarray) -> float:
    """One number for standard deviations (3,) of the axes: their rms, as for equal axes."""
    return float(np.sqrt(np.mean(np.square(std_mm))))


@dataclass(frozen=True)
class Repeats:
    """Scatter of readings taken at one configuration.

    ``std_mm`` (3,) pooled per axis of the instrument, of ``freedom`` degrees each; ``groups``
    configurations and targets with more than one reading, ``readings`` in them; ``deviation_mm``
    (n, 3) of every reading from the median of the others there, NaN where it is alone; ``common``
    correlation of the deviations of different targets, NaN for one target.
    """

    std_mm: np.ndarray
    freedom: int
    groups: int
    readings: int
    deviation_mm: np.ndarray
    common: float


def repeats(cells: Cells, cell: np.ndarray) -> Repeats:
    """Scatter within the cells (n,) of the readings, one per configuration and target."""
    deviation = np.full(cells.position_mm.shape, np.nan)
    centred = np.full(cells.position_mm.shape, np.nan)
    counts = np.bincount(cell)
    squares, freedom = np.zeros(3), 0
    order = np.argsort(cell, kind="stable")
    ends = np.cumsum(counts)
    for number in np.flatnonzero(counts > 1):
        rows = order[ends[number] - counts[number] : ends[number]]
        points = cells.position_mm[rows]
        centred[rows] = points - points.mean(axis=0)
        for place, row in enumerate(rows):
            deviation[row] = points[place] - np.median(np.delete(points, place, axis=0), axis=0)
        # Pooled by medians of pairs would waste readings; gross ones are cut at six medians.
        length = np.linalg.norm(centred[rows], axis=1)
        good = length <= 6.0 * max(np.median(length), 1e-12)
        squares += np.sum((points[good] - points[good].mean(axis=0)) ** 2, axis=0)
        freedom += int(good.sum()) - 1
    groups = int(np.sum(counts > 1))
    std = np.sqrt(squares / freedom) if freedom > 0 else np.full(3, np.nan)
    readings = int(counts[counts > 1].sum())
    return Repeats(std, freedom, groups, readings, deviation, _common(cells, centred))


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
class Revisits:
    """Scatter of what a fit leaves at configurations that were gone to more than once.

    ``std_mm`` (3,) pooled per axis of the instrument, NaN where none was, of ``freedom`` degrees;
    it holds the arm's own repeatability besides the instrument's noise.
    """

    std_mm: np.ndarray
    configurations: int
    readings: int
    freedom: int


def revisits(
    session: np.ndarray, target: np.ndarray, left_mm: np.ndarray, same: np.ndarray
) -> Revisits:
    """Scatter of residuals ``left_mm`` (n, 3) of poses of one configuration ``same`` (n,).

    Those of one ``session`` (n,) and ``target`` (n,) are compared, given as numbers; the fit takes
    out what little the joints differ.
    """
    label = np.column_stack([same, session, target])
    number = np.unique(label, axis=0, return_inverse=True)[1].ravel()
    counts = np.bincount(number)
    again = counts[number] > 1
    if not again.any():
        return Revisits(np.full(3, np.nan), 0, 0, 0)
    sums = np.stack([np.bincount(number, left_mm[:, axis]) for axis in range(3)], axis=1)
    centred = (left_mm - (sums / counts[:, None])[number])[again]
    length = np.linalg.norm(centred, axis=1)
    good = length <= 6.0 * max(np.median(length), 1e-12)
    used = number[again][good]
    freedom = len(used) - np.unique(used).size
    std = np.sqrt(np.sum(centred[good] ** 2, axis=0) / max(freedom, 1))
    return Revisits(std, int(np.unique(same[again]).size), int(again.sum()), freedom)


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
