"""Readings of a measured file as the checks compare them, repeats and distances of targets."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy import ndarray

from kinacc.calibration.observations import Observations, from_columns
from kinacc.checks import tails
from kinacc.geometry import project_so3
from kinacc.kinematics.robot import Robot
from kinacc.measurements.reader import MeasuredFile
from kinacc.measurements.row_names import RowNames
from kinacc.tables.columns import texts

_SAME_RAD = 1e-4  # joints of repeats differ by less


@dataclass(frozen=True, kw_only=True)
class Readings(Observations):
    """Observations in the order of the file, with what they were read from.

    Where base or target count as another from a row on, ``session`` and ``target`` have a further
    number, whose name is that of the one before.

    Attributes
    ----------
    q, commanded
        Joints as read and as commanded, shape (n, k), rad or mm, NaN where the file has none;
        ``q_rad`` are the DH joints they mean.
    turns
        Orientations as written, shape (n, 3 or 4), rad.
    line
        Line of the file (n,), the first where repeats were merged; ``drawn`` (n,) all of them.
    row_names
        How rows are called.
    """

    q: ndarray
    commanded: ndarray
    turns: ndarray
    line: ndarray
    drawn: ndarray
    row_names: RowNames

    def lines(self, rows: ndarray | slice = slice(None)) -> list[int]:
        """All lines of the file that ``rows`` were read from, each once, in order."""
        return np.unique(np.concatenate(self.drawn[rows])).tolist() if len(self.q[rows]) else []


def of_file(reading: MeasuredFile, robot: Robot) -> Readings:
    """Readings of a measured file, one for each target of each row."""
    columns, line = reading.columns, np.asarray(reading.columns["row"])
    q = np.stack([columns[f"q{i + 1}"] for i in range(robot.dh.joints)], axis=1)
    return Readings(
        **vars(from_columns(columns, robot)),
        q=q,
        commanded=np.full_like(q, np.nan) if reading.commanded is None else reading.commanded,
        turns=np.asarray(reading.turns),
        line=line,
        drawn=texts(np.split(line, np.arange(1, len(line)))),
        row_names=reading.row_names,
    )


def merged(every: Readings) -> tuple[Readings, ndarray]:
    """One reading per pose and target, the median of its repeats.

    Readings of a pose whose joints differ stay apart, and so do repeats far from the others. Also
    the distance (n,) of every repeat from their median, mm, NaN where there is one.
    """
    joints = np.round(every.q / _SAME_RAD).astype(np.int64)
    cell = grouped(every.session, every.pose, every.target, joints)
    middle = pd.DataFrame(every.position_mm).groupby(cell).transform("median")
    away = np.linalg.norm(every.position_mm - middle, axis=1)
    count = np.bincount(cell)[cell]
    away[count == 1] = np.nan
    alone = (count > 2) & (away > tails.limit(away[count > 2], 3))
    cell = pd.factorize(np.where(alone, len(cell) + np.arange(len(cell)), cell))[0]
    first = every.select(np.unique(cell, return_index=True)[1])
    values = np.column_stack([every.position_mm, every.rotation.reshape(-1, 9)])
    medians = pd.DataFrame(values).groupby(cell).median().to_numpy()
    turned = np.isfinite(medians[:, 3])
    rotation = first.rotation.copy()
    rotation[turned] = project_so3(medians[turned, 3:].reshape(-1, 3, 3))
    ends = np.cumsum(np.bincount(cell))[:-1]
    drawn = texts(np.split(every.line[np.argsort(cell, kind="stable")], ends))
    return replace(first, position_mm=medians[:, :3], rotation=rotation, drawn=drawn), away


def grouped(*labels: ndarray) -> ndarray:
    """Number (n,) of each row of labels, equal rows alike, in order of first appearance."""
    frame = pd.DataFrame(np.column_stack(labels))
    return frame.groupby(list(frame), sort=False, dropna=False).ngroup().to_numpy()


def parted(observed: Readings, row: int, kind: str) -> tuple[Readings, ndarray]:
    """Readings whose base or target is another one from ``row`` on, and those from there on."""
    label, names = getattr(observed, kind), getattr(observed, f"{kind}_names")
    rows = (np.arange(len(observed)) >= row) & (label == label[row])
    split: dict[str, Any] = {kind: np.where(rows, len(names), label)}
    split[f"{kind}_names"] = (*names, names[label[row]])
    return replace(observed, **split), np.flatnonzero(rows)


def thinned(rows: ndarray, most: int) -> ndarray:
    """At most ``most`` of ``rows``, spread evenly."""
    return rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int)]
