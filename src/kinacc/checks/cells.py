"""Measured points as the arrays every check works on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from kinacc.checks import tails
from kinacc.geometry import rotation_from_quaternion
from kinacc.measurements.row_names import RowNames
from kinacc.tables.columns import texts


@dataclass(frozen=True)
class Cells:
    """n readings of targets, in the order of the file.

    ``q`` (n, k) reported joints (rad, mm where one slides); ``position_mm`` (n, 3) and ``rotation``
    (n, 3, 3), NaN where not measured, in the instrument's frame; ``target``, ``session``, ``pose``,
    ``repeat`` (n,) indices; ``line`` (n,) of the file, the first where readings were drawn
    together, ``drawn`` (n,) tuples of all their lines, ``row_names`` what these are called.
    """

    q: np.ndarray
    position_mm: np.ndarray
    rotation: np.ndarray
    target: np.ndarray
    session: np.ndarray
    pose: np.ndarray
    repeat: np.ndarray
    line: np.ndarray
    drawn: np.ndarray
    target_names: tuple[str, ...]
    session_names: tuple[str, ...]
    row_names: RowNames

    def __len__(self) -> int:
        return len(self.q)

    @property
    def turned(self) -> np.ndarray:
        """True (n,) where the orientation was measured."""
        return np.isfinite(self.rotation[:, 0, 0])

    def lines(self, rows: np.ndarray | slice = slice(None)) -> list[int]:
        """All lines of the file the cells ``rows`` were read from, each once, in order."""
        return sorted({line for lines in self.drawn[rows] for line in lines})

    def select(self, rows: np.ndarray) -> Cells:
        """The readings of ``rows`` (mask or indices)."""
        columns = {
            field.name: getattr(self, field.name)[rows]
            for field in fields(self)
            if not field.name.endswith("_names")
        }
        return replace(self, **columns)


def of_columns(columns: Mapping[str, np.ndarray], joints: int, row_names: RowNames) -> Cells:
    """Cells of the columns of a reading."""
    target_names, target = _numbered(columns["target"])
    session_names, session = _numbered(columns["session"])
    quaternion = np.stack([columns[f"q{part}"] for part in "wxyz"], axis=1)
    return Cells(
        q=np.stack([columns[f"q{i + 1}"] for i in range(joints)], axis=1),
        position_mm=np.stack([columns[f"{axis}_mm"] for axis in "xyz"], axis=1),
        rotation=rotation_from_quaternion(quaternion),
        target=target,
        session=session,
        pose=np.asarray(columns["pose"]),
        repeat=np.asarray(columns["repeat"]),
        line=np.asarray(columns["row"]),
        drawn=texts([(line,) for line in columns["row"].tolist()]),
        target_names=target_names,
        session_names=session_names,
        row_names=row_names,
    )


def merged(cells: Cells, tolerance: float = 1e-4) -> tuple[Cells, np.ndarray]:
    """One cell per pose and target, the median of its readings, and the cell (n,) of each reading.

    Readings of a pose whose joints differ by more than ``tolerance`` (rad) stay apart, and so do
    readings far from the others of their pose.
    """
    joints = np.round(cells.q / tolerance).astype(np.int64)
    label = np.column_stack([cells.session, cells.pose, cells.target, joints])
    cell = _numbers(label)
    alone = _far_from_others(cells, cell)
    cell = _numbers(np.where(alone, cell.max() + 1 + np.arange(len(cell)), cell)[:, None])
    one = cells.select(np.unique(cell, return_index=True)[1])
    if len(one) == len(cells):
        return one, cell
    position, rotation = one.position_mm.copy(), one.rotation.copy()
    drawn = one.drawn.copy()
    for number in np.flatnonzero(np.bincount(cell) > 1):
        rows = np.flatnonzero(cell == number)
        drawn[number] = tuple(cells.line[rows].tolist())
        position[number] = np.median(cells.position_mm[rows], axis=0)
        turned = rows[cells.turned[rows]]
        if turned.size:
            rotation[number] = nearest_rotation(np.median(cells.rotation[turned], axis=0))
    return replace(one, position_mm=position, rotation=rotation, drawn=drawn), cell


def _numbers(label: np.ndarray) -> np.ndarray:
    """Number (n,) of each row of ``label``, equal ones alike, in order of first appearance."""
    _, first, inverse = np.unique(label, axis=0, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse.ravel()]


def _far_from_others(cells: Cells, cell: np.ndarray) -> np.ndarray:
    """True (n,) where a reading is too far from the median of its cell to be a repeat."""
    away = np.full(len(cells), np.nan)
    for number in np.flatnonzero(np.bincount(cell) > 2):
        rows = np.flatnonzero(cell == number)
        middle = np.median(cells.position_mm[rows], axis=0)
        away[rows] = np.linalg.norm(cells.position_mm[rows] - middle, axis=1)
    repeated = np.isfinite(away)
    return repeated & (away > tails.limit(away[repeated], 3))


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """Rotation nearest to ``matrix`` (3, 3)."""
    left, _, right = np.linalg.svd(matrix)
    left[:, 2] *= np.sign(np.linalg.det(left @ right))
    return left @ right


def _numbered(labels: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    names = tuple(dict.fromkeys("" if label is None else str(label) for label in labels))
    number = {name: i for i, name in enumerate(names)}
    return names, np.array([number["" if x is None else str(x)] for x in labels], dtype=np.int64)
