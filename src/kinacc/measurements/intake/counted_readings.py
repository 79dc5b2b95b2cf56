"""Names of poses that count their readings: P12_1 and P12-2 of equal joints."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from kinacc.measurements.column_names import Name, name_of
from kinacc.measurements.intake.columns import NamedColumns
from kinacc.measurements.table import RawTable

_AGAIN = re.compile(r"(?<=\d)[_-]\d+$")
_SAME_DEG = 0.02
_MOST_RAD = 2.1 * np.pi
_APPROACH_TEXT = """
approach approached anfahrt anfahrrichtung richtung direction sens approche direccion direzione
avvicinamento sentido dir
"""
_APPROACH = frozenset(_APPROACH_TEXT.split())


def found(
    table: RawTable, columns: NamedColumns, values: Callable[[Name], np.ndarray]
) -> tuple[bool, tuple[str, ...]]:
    """Whether numbers behind the names of poses count readings of them, and what to say of it.

    Readings that came from other directions stay poses of their own: as repeats they would scatter
    by the arm's backlash.
    """
    several = _poses(table, columns, values)
    if not several:
        return False, ()
    side = _approached(table, columns, several)
    if not side:
        return True, ()
    told = (
        f"{side} differs between readings of a pose: they stay poses of their own. Columns s1 .. "
        "would say from which side each joint came (-1, 0, 1)"
    )
    return False, (told,)


def _poses(
    table: RawTable, columns: NamedColumns, values: Callable[[Name], np.ndarray]
) -> list[list[int]]:
    """Rows of every pose of several readings; none where names count something else."""
    if "pose" not in columns.single or not columns.joints:
        return []
    told = [str(cell).strip() for cell in table.columns[columns.single["pose"].column]]
    poses = [_AGAIN.sub("", each) for each in told]
    if any(a == b for a, b in zip(told, poses, strict=True)) or len(set(told)) < len(told):
        return []
    q = np.stack([values(name) for name in columns.joints], axis=1)
    q = q if np.nanmax(np.abs(q), initial=0.0) > _MOST_RAD else np.rad2deg(q)
    rows: dict[str, list[int]] = {}
    for row, pose in enumerate(poses):
        rows.setdefault(pose, []).append(row)
    several = [each for each in rows.values() if len(each) > 1]
    return several if all(np.ptp(q[each], axis=0).max() < _SAME_DEG for each in several) else []


def _approached(table: RawTable, columns: NamedColumns, poses: list[list[int]]) -> str:
    """The column that states other directions of approach within a pose, empty for none."""
    for column, cells in table.columns.items():
        about = _APPROACH & {*name_of(column).words} and column not in columns.read()
        if about and any(len({str(cells[row]) for row in rows}) > 1 for rows in poses):
            return column
    return ""
