"""Rows of one pose: which column tells their targets apart, and whether its names count them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.measurements.column_names import Name, name_of
from kinacc.measurements.intake.columns import NamedColumns
from kinacc.measurements.intake.groups import RADIUS, keeps_distance
from kinacc.measurements.reader import AGAIN
from kinacc.measurements.table import RawTable
from kinacc.measurements.words import WORDS

_APART_MM = 5.0  # readings of one target of a pose lie nearer to each other
_STILL_RAD = 5e-4
_MOST_TARGETS = 24
_SAME_RADIUS = 0.05  # of the largest: radii that were measured scatter
_ALLOWED = "a column target that names the reflector of every row"
Told = tuple[NamedColumns, tuple[str, ...]]


def told_apart(
    table: RawTable, found: NamedColumns, q_rad: np.ndarray, point: np.ndarray,
    values: Callable[[Name], np.ndarray],
) -> Told:  # fmt: skip
    """The columns with that of the targets, where one is needed, and what to say of it.

    ``q_rad`` (n, k) and ``point`` (n, 3) in mm. Raises InputError where rows are of several targets
    and no column names them.
    """
    if len(found.targets) != 1:
        return found, ()
    keys: Iterable[Hashable] = map(tuple, q_rad.tolist())
    if "pose" in found.single:
        several = [found.single[n].column for n in ("pose", "session") if n in found.single]
        keys = zip(*(table.texts(name) for name in several), strict=True)
    poses = [rows for rows in _rows_of(keys) if np.isfinite(q_rad[rows]).all()]
    if not all(np.ptp(q_rad[each], axis=0).max() < _STILL_RAD for each in poses):
        poses = []
    for group, _ in found.aside:
        if group.kind == RADIUS:
            size = values(group.columns["radius"])
            spread = np.ptp(size[np.isfinite(size)]) if np.isfinite(size).any() else 0.0
            if spread > _SAME_RADIUS * np.nanmax(np.abs(size), initial=0.0):
                return _by_radius(table, found, group.names[0], size, point, poses)
    if "target" in found.single or not _apart(point, poses):
        return found, ()
    ways: dict[tuple, str] = {}
    for column in (each for each in table.columns if each not in found.read()):
        labels = table.texts(column)
        if _tells(labels, point, poses):
            ways.setdefault(tuple(map(labels.index, labels)), column)
    if len(ways) != 1:
        names = f"each of {', '.join(ways.values())} may name" if ways else "no column names"
        what = (
            f"rows of equal joints lie more than {_APART_MM:g} mm apart, and {names} their target"
        )
        raise InputError(Problem(table.path, what, _ALLOWED, "a column session names set-ups"))
    return _with_target(found, next(iter(ways.values())), "keep their distances to each other")


def _with_target(found: NamedColumns, column: str, why: str) -> Told:
    """The columns, and ``column`` as that of the targets."""
    told = f"{column} names the targets, which {why}"
    return replace(found, single=found.single | {"target": name_of(column)}), (told,)


def _by_radius(
    table: RawTable, found: NamedColumns, column: str, size: np.ndarray, point: np.ndarray, poses
) -> Told:
    """A reflector of another radius has its centre elsewhere in the same nest."""
    if "target" in found.single:
        labels = table.texts(found.single["target"].column)
        wrong = len({*zip(labels, size.tolist(), strict=True)}) > len({*labels})
    else:  # readings of a pose and of one radius that are not those of one point
        alike = [[row for row in rows if size[row] == one] for rows in poses for one in {*size}]
        wrong = _apart(point, [e for e in alike if e]) or len({*size}) > _MOST_TARGETS
    if wrong:
        what = "the radius of the reflectors changes, so that their centres lie elsewhere"
        raise InputError(Problem(table.where(column), what, _ALLOWED))
    if "target" in found.single:
        return found, ()
    return _with_target(found, column, "have their centres elsewhere in the same nest")


def _rows_of(keys: Iterable[Hashable]) -> list[list[int]]:
    """Rows of every key that has several."""
    rows: dict[Hashable, list[int]] = {}
    for row, key in enumerate(keys):
        rows.setdefault(key, []).append(row)
    return [each for each in rows.values() if len(each) > 1]


def _apart(point: np.ndarray, poses: Sequence[Sequence[int]]) -> bool:
    """Whether rows of a pose are, as a rule, far from each other."""
    spans = np.array([np.ptp(point[rows], axis=0).max() for rows in poses])
    spans = spans[np.isfinite(spans)]
    return bool(spans.size) and float(np.median(spans)) > _APART_MM


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
            own[:] = point[row]
    return all(keeps_distance(one, other) for one, other in combinations(place, 2))


def counted(
    table: RawTable, found: NamedColumns, q_rad: np.ndarray
) -> tuple[bool, tuple[str, ...]]:
    """Whether numbers behind the names of poses count readings of them, and what to say of it.

    Readings that came from other directions stay poses of their own: as repeats they would scatter
    by the arm's backlash.
    """
    told = table.texts(found.single["pose"].column) if "pose" in found.single else []
    poses = [AGAIN.sub("", each) for each in told]
    if any(a == b for a, b in zip(told, poses, strict=True)) or len({*told}) < len(told):
        return False, ()
    several = _rows_of(poses)
    if not several or not all(np.ptp(q_rad[r], axis=0).max() < _STILL_RAD for r in several):
        return False, ()
    for column in (each for each in table.columns if each not in found.read()):
        cells = table.texts(column)
        about = WORDS["approach"] & {*name_of(column).words}
        if about and any(len({cells[row] for row in rows}) > 1 for rows in several):
            told_ = f"{column} differs between readings of a pose: they stay poses of their own. "
            told_ += "Columns s1 .. would say from which side each joint came (-1, 0, 1)"
            return False, (told_,)
    return True, ()
