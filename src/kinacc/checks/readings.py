"""Readings of a measured file as the checks compare them, repeats and distances of targets."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
import pandas as pd

from kinacc.calibration.observations import Observations, from_columns
from kinacc.checks import tails
from kinacc.kinematics.robot import Robot
from kinacc.measurements.reader import MeasuredFile
from kinacc.measurements.row_names import RowNames
from kinacc.tables.columns import texts

_SAME_RAD = 1e-4  # joints of repeats differ by less
_MEDIAN_1D = 0.6744897501960817  # median of |x| of a standard normal number


@dataclass(frozen=True)
class Readings(Observations):
    """Observations in the order of the file, with what they were read from.

    Where base or target count as another from a row on, ``session`` and ``target`` have a further
    number, whose name is that of the one before.

    Attributes
    ----------
    q
        Joints as read, shape (n, k), rad or mm; ``q_rad`` are the DH joints they mean.
    line
        Line of the file (n,), the first where repeats were merged; ``drawn`` (n,) all of them.
    row_names
        How rows are called.
    """

    q: np.ndarray = None
    line: np.ndarray = None
    drawn: np.ndarray = None
    row_names: RowNames = field(default_factory=RowNames)

    def lines(self, rows: np.ndarray | slice = slice(None)) -> list[int]:
        """All lines of the file that ``rows`` were read from, each once, in order."""
        return np.unique(np.concatenate(self.drawn[rows])).tolist() if len(self.q[rows]) else []


def of_file(reading: MeasuredFile, robot: Robot) -> Readings:
    """Readings of a measured file, one for each target of each row."""
    columns, line = reading.columns, np.asarray(reading.columns["row"])
    return Readings(
        **vars(from_columns(columns, robot)),
        q=np.stack([columns[f"q{i + 1}"] for i in range(robot.dh.joints)], axis=1),
        line=line,
        drawn=texts(np.split(line, np.arange(1, len(line)))),
        row_names=reading.row_names,
    )


def merged(every: Readings) -> tuple[Readings, np.ndarray]:
    """One reading per pose and target, the median of its repeats, and its number (n,) for each.

    Readings of a pose whose joints differ stay apart, and so do readings far from the others of
    their pose.
    """
    joints = np.round(every.q / _SAME_RAD).astype(np.int64)
    cell = grouped(every.session, every.pose, every.target, joints)
    middle = pd.DataFrame(every.position_mm).groupby(cell).transform("median")
    away = np.linalg.norm(every.position_mm - middle, axis=1)
    repeated = np.bincount(cell)[cell] > 2
    alone = repeated & (away > tails.limit(away[repeated], 3))
    cell = pd.factorize(np.where(alone, len(cell) + np.arange(len(cell)), cell))[0]
    one = every.select(np.unique(cell, return_index=True)[1])
    if len(one) == len(every):
        return one, cell
    values = np.column_stack([every.position_mm, every.rotation.reshape(-1, 9)])
    medians = pd.DataFrame(values).groupby(cell).median().to_numpy()
    several = np.bincount(cell) > 1
    turned = several & np.isfinite(medians[:, 3])
    rotation = one.rotation.copy()
    rotation[turned] = nearest_rotation(medians[turned, 3:].reshape(-1, 3, 3))
    ends = np.cumsum(np.bincount(cell))[:-1]
    return replace(
        one,
        position_mm=np.where(several[:, None], medians[:, :3], one.position_mm),
        rotation=rotation,
        drawn=texts(np.split(every.line[np.argsort(cell, kind="stable")], ends)),
    ), cell


def grouped(*labels: np.ndarray) -> np.ndarray:
    """Number (n,) of each row of labels, equal rows alike, in order of first appearance."""
    frame = pd.DataFrame(np.column_stack(labels))
    return frame.groupby(list(frame), sort=False, dropna=False).ngroup().to_numpy()


def deviations_mm(every: Readings, cell: np.ndarray) -> np.ndarray:
    """Deviation (n, 3) of every reading from the median of the others of its cell (n,), or NaN."""
    deviation = np.full(every.position_mm.shape, np.nan)
    order, counts = np.argsort(cell, kind="stable"), np.bincount(cell)
    for rows in np.split(order, np.cumsum(counts)[:-1]):
        points = every.position_mm[rows]
        for place in range(len(rows) if len(rows) > 1 else 0):
            others = np.delete(points, place, axis=0)
            deviation[rows[place]] = points[place] - np.median(others, axis=0)
    return deviation


def correlation(every: Readings, cell: np.ndarray) -> float:
    """Correlation of repeats of different targets of a row, NaN where there are none."""
    mean = pd.DataFrame(every.position_mm).groupby(cell).transform("mean")
    centred = np.where((np.bincount(cell)[cell] > 1)[:, None], every.position_mm - mean, np.nan)
    found = []
    for _, _, rows in _side_by_side(every):
        a, b = centred[rows[:, 0]], centred[rows[:, 1]]
        both = np.isfinite(a[:, 0]) & np.isfinite(b[:, 0])
        scale = np.sqrt(np.sum(a[both] ** 2) * np.sum(b[both] ** 2))
        if both.sum() > 3 and scale > 0.0:
            found.append(np.sum(a[both] * b[both]) / scale)
    return float(np.mean(found)) if found else np.nan


@dataclass(frozen=True)
class Distance:
    """Distance between targets ``one`` and ``other``, row by row in the order of the file.

    ``rows`` (m, 2) indices of the two readings, ``length_mm`` (m,); ``middle_mm`` and robust
    ``std_mm`` over all of them.
    """

    one: int
    other: int
    rows: np.ndarray
    length_mm: np.ndarray
    middle_mm: float
    std_mm: float


def distances(every: Readings) -> list[Distance]:
    """Distances of all pairs of targets that were seen together often enough to compare."""
    found = []
    for one, other, rows in _side_by_side(every):
        if len(rows) >= 3:
            rows = rows[np.argsort(every.line[rows[:, 0]], kind="stable")]
            ends = every.position_mm[rows]
            length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
            middle = float(np.median(length))
            std = float(np.median(np.abs(length - middle))) / _MEDIAN_1D
            found.append(Distance(one, other, rows, length, middle, std))
    return found


def _side_by_side(every: Readings) -> list[tuple[int, int, np.ndarray]]:
    """Pairs of targets with the readings (m, 2) of them that were taken together."""
    number = grouped(every.session, every.pose, every.repeat)
    place = np.full((number.max() + 1, len(every.target_names)), -1)
    place[number, every.target] = np.arange(len(every))
    pairs = combinations(range(place.shape[1]), 2)
    return [(*pair, rows[(rows >= 0).all(axis=1)]) for pair in pairs for rows in [place[:, pair]]]


def thinned(rows: np.ndarray, most: int) -> np.ndarray:
    """At most ``most`` of ``rows``, spread evenly."""
    if len(rows) <= most:
        return rows
    return rows[np.linspace(0, len(rows) - 1, most).astype(int)]


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """Rotations nearest to ``matrix`` (..., 3, 3)."""
    left, _, right = np.linalg.svd(matrix)
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[..., None]
    return left @ right
