"""Which column tells apart the targets of a file that has a row for every target of a pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.measurements.column_names import Name, name_of
from kinacc.measurements.intake.columns import NamedColumns
from kinacc.measurements.intake.groups import RADIUS, keeps_distance
from kinacc.measurements.table import RawTable

_APART_MM = 5.0  # readings of one target of a pose lie nearer to each other
_STILL_RAD = 5e-4
_MOST_TARGETS = 24
_SAME_RADIUS = 0.05  # of the largest: radii that were measured scatter
_ALLOWED = "a column target that names the reflector of every row"
_FIX = "add one; a column session tells apart the set-ups of the instrument"


def told_apart(
    table: RawTable,
    found: NamedColumns,
    values: Callable[[Name], np.ndarray],
    rad: float | np.ndarray,
    length_mm: float,
) -> tuple[NamedColumns, tuple[str, ...]]:
    """The columns with that of the targets, where one is needed, and what to say of it.

    ``rad`` and ``length_mm``: units of the joints and positions. Raises InputError where rows are
    of several targets and no column names them.
    """
    if len(found.targets) != 1 or found.questions:
        return found, ()
    (target,) = found.targets.values()
    point = np.stack([values(target[axis]) for axis in "xyz"], axis=1) * length_mm
    poses = _poses(table, found, np.stack([values(name) for name in found.joints], axis=1) * rad)
    if radius := _changing(found, values):
        size = values(radius)
        alike = [[row for row in rows if size[row] == one] for rows in poses for one in set(size)]
        return _by_radius(table, found, radius, size, _apart(point, [e for e in alike if e]))
    if "target" in found.single:
        return found, ()
    if not _apart(point, poses):
        return found, ()
    ways = {}
    for column in table.columns:
        if column not in found.read():
            labels = [str(cell).strip() for cell in table.columns[column]]
            if _tells(labels, point, poses):
                ways.setdefault(tuple(labels.index(each) for each in labels), column)
    if len(ways) != 1:
        names = f"each of {', '.join(ways.values())} may name" if ways else "no column names"
        what = (
            f"rows of equal joints lie more than {_APART_MM:g} mm apart, and {names} their target"
        )
        raise InputError(Problem(table.path, what, _ALLOWED, _FIX))
    return _with_target(found, next(iter(ways.values())), "keep their distances to each other")


def _with_target(
    found: NamedColumns, column: str, why: str
) -> tuple[NamedColumns, tuple[str, ...]]:
    """The columns, and ``column`` as that of the targets."""
    told = f"{column} names the targets, which {why}"
    return replace(found, single=found.single | {"target": name_of(column)}), (told,)


def _changing(found: NamedColumns, values: Callable[[Name], np.ndarray]) -> Name | None:
    """The column of a radius that is not the same in all rows."""
    for group, _ in found.aside:
        if group.kind == RADIUS:
            radius = values(group.columns["radius"])
            radius = radius[np.isfinite(radius)]
            if radius.size and np.ptp(radius) > _SAME_RADIUS * np.abs(radius).max():
                return group.columns["radius"]
    return None


def _by_radius(
    table: RawTable, found: NamedColumns, radius: Name, size: np.ndarray, apart: bool
) -> tuple[NamedColumns, tuple[str, ...]]:
    """A reflector of another radius has its centre elsewhere in the same nest.

    ``apart``: readings of a pose and of one radius are not those of one point.
    """
    labels = table.columns[found.single["target"].column] if "target" in found.single else ()
    pairs = set(zip(labels, size.tolist(), strict=False))
    unnamed = not labels and (apart or len(set(size.tolist())) > _MOST_TARGETS)
    if unnamed or (labels and len(pairs) > len(set(labels))):
        what = "the radius of the reflectors changes, so that their centres lie elsewhere"
        where = f"{table.path}: column {radius.column}"
        raise InputError(Problem(where, what, _ALLOWED, _FIX))
    if labels:
        return found, ()
    return _with_target(found, radius.column, "have their centres elsewhere in the same nest")


def _poses(table: RawTable, found: NamedColumns, q_rad: np.ndarray) -> list[list[int]]:
    """Rows of every pose of several rows; none where rows of a pose differ in their joints."""
    if "pose" in found.single:
        several = [found.single[n].column for n in ("pose", "session") if n in found.single]
        keys = list(zip(*(map(str, table.columns[name]) for name in several), strict=True))
    else:
        keys = [tuple(row) for row in q_rad.tolist()]
    rows: dict[tuple, list[int]] = {}
    for row, key in enumerate(keys):
        if np.isfinite(q_rad[row]).all():
            rows.setdefault(key, []).append(row)
    poses = [each for each in rows.values() if len(each) > 1]
    return poses if all(np.ptp(q_rad[each], axis=0).max() < _STILL_RAD for each in poses) else []


def _apart(point: np.ndarray, poses: Sequence[Sequence[int]]) -> bool:
    """Whether rows of a pose are, as a rule, far from each other."""
    spans = [np.ptp(point[rows], axis=0).max() for rows in poses]
    spans = [each for each in spans if np.isfinite(each)]
    return bool(spans) and float(np.median(spans)) > _APART_MM


def _tells(labels: Sequence[str], point: np.ndarray, poses: Sequence[Sequence[int]]) -> bool:
    """Whether labels stand for points of one body, each read about once in most poses."""
    names = list(dict.fromkeys(labels))
    if not 2 <= len(names) <= _MOST_TARGETS:
        return False
    place = np.full((len(names), len(poses), 3), np.nan)
    for pose, rows in enumerate(poses):
        for row in rows:
            own = place[names.index(labels[row]), pose]
            if np.isfinite(own).all() and np.abs(point[row] - own).max() > _APART_MM:
                return False
            place[names.index(labels[row]), pose] = point[row]
    return all(keeps_distance(one, other) for one, other in combinations(place, 2))
