"""Joints of one file put beside the points of another: by a name, by time, or by order."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.measurements.table import RawTable, numbers
from kinacc.measurements.times import seconds

NAME, TIME, ORDER = "name", "time", "order"
STILL_RAD = np.deg2rad(0.02)  # joints that move less stand still
_NUMBER = re.compile(r"(?<!\d)\d{1,100}(?!\d)")  # longer ones number nothing
_AGAIN = re.compile(r"(?<=\d)[_-]\d+$")  # P12_1, P12-2: the readings of P12
_BESIDE = re.compile(r"[\s\[\](){}\"']+")
_OTHER = "joints file "  # before columns of the joints' file whose name the points' file has too


@dataclass(frozen=True)
class Join:
    """How rows of two files belong together.

    ``by`` a name (of columns ``key`` of the joints and ``key_of_points``), by time (of these
    columns: a point's clock shows ``clock_offset_s`` less than the joints') or by order. Joints
    within ``within_s`` of a point are those of the point, if the arm stood still.
    """

    by: str
    key: str | None = None
    key_of_points: str | None = None
    clock_offset_s: float = 0.0
    within_s: float = 0.5

    @classmethod
    def of(cls, section: Mapping) -> Join:
        """From the configuration section ``measurements.file.joints``."""
        names = ("by", "key", "key_of_points", "clock_offset_s", "within_s")
        return cls(*(section[name] for name in names))


def joined(points: RawTable, joints: RawTable, how: Join) -> RawTable:
    """Rows of the points with the joints beside them, under the lines of the points.

    ``notes`` of the table say which rows found none. Raises InputError where keys are missing,
    doubled with other joints, or match nothing.
    """
    row, notes = pairs(points, joints, how)
    kept = np.flatnonzero(row >= 0)
    if not kept.size:
        what = f"no row belongs to any of {joints.path}, joined by {how.by}"
        fix = "correct measurements.file.joints"
        raise InputError(Problem(points.path, what, "rows of the same poses", fix))
    named = points.with_pose_names(how.key_of_points or "") if how.by == NAME else points
    table = replace(named.select(kept), points_file=Path(points.path).name, key=how.key_of_points)
    beside = joints.select(row[kept])
    columns = table.columns | {
        beside_name(name, points): cells for name, cells in beside.columns.items()
    }
    under = [*points.under, *[""] * (len(points.columns) - len(points.under)), *joints.under]
    decimal = points.decimal
    if (joints.decimal, joints.thousands) != (decimal, points.thousands):
        for name, cells in beside.columns.items():  # cells are numbers of their own file
            columns[beside_name(name, points)] = [_marked(cell, joints, decimal) for cell in cells]
    return replace(
        table,
        columns=columns,
        under=tuple(under) if points.under or joints.under else (),
        notes=(*points.notes, *joints.notes, *notes),
    )


def beside_name(column: str, points: RawTable) -> str:
    """What a column of the joints' file is called beside the points."""
    return f"{_OTHER}{column}" if column in points.columns else column


def _marked(cell: object, own: RawTable, decimal: str) -> object:
    if not isinstance(cell, str):
        return cell
    plain = cell.replace(own.thousands, "") if own.thousands else cell
    return plain.replace(own.decimal, decimal)


def pairs(points: RawTable, joints: RawTable, how: Join) -> tuple[np.ndarray, tuple[str, ...]]:
    """Row of the joints (n,) of every point, -1 for none, and what is left over, in words."""
    problems = [
        Problem(f"measurements.file.joints.{key}", f"{table.path} has no column {name}")
        for key, name, table in (
            ("key", how.key, joints),
            ("key_of_points", how.key_of_points, points),
        )
        if how.by != ORDER and name not in table.columns
    ]
    refuse(problems)
    if how.by == ORDER:
        if len(points) != len(joints):
            what = f"{len(points)} rows, and {len(joints)} rows of joints in {joints.path}"
            raise InputError(Problem(points.path, what, "as many of both to join them by order"))
        return np.arange(len(points)), ()
    if how.by == NAME:
        row = by_name(points, joints, how)
        spare = np.setdiff1d(np.arange(len(joints)), row)
        none = np.flatnonzero(row < 0)
        alone = _left(points, none, joints, key=how.key_of_points)
        return row, (*alone, *_left(joints, spare, points, key=how.key))
    row, moving = by_time(points, joints, how)
    none = np.flatnonzero((row < 0) & ~moving)
    notes = [*_left(points, none, joints, "no joints at their time")]
    if moving.any():
        lines = points.rows_in_words(np.flatnonzero(moving))
        notes.append(f"{points.path}: the arm was moving at {lines}, which are left out")
    return row, tuple(notes)


def _left(
    table: RawTable,
    rows: np.ndarray,
    other: RawTable,
    what: str = "no partner",
    key: str | None = None,
) -> list[str]:
    """Rows of a table that the other has no partner of, by their lines and names."""
    if not rows.size:
        return []
    names = first_few([str(table.columns[key][row]).strip() for row in rows], 5) if key else ""
    named = f", {key} {names}" if key else ""
    many = len(rows) > 1
    have = f"{len(rows)} row{'s' if many else ''} of {table.path} {'have' if many else 'has'}"
    left = f"{'are' if many else 'is'} left out: {table.rows_in_words(rows)}{named}"
    return [f"{have} {what} in {other.path} and {left}"]


def by_name(points: RawTable, joints: RawTable, how: Join) -> np.ndarray:
    """Row of the joints (n,) of the same name as every point, -1 for none."""
    names, others = labels(points.columns[how.key_of_points]), labels(joints.columns[how.key])
    best: tuple[int, list[str], list[str]] = (-1, names, others)
    for here, there in _ways(names, others):
        found = sum(name in set(there) for name in here)
        if found > best[0]:
            best = (found, here, there)
    _, here, there = best
    _refuse_doubled(joints, how.key, there)
    first = {name: row for row, name in reversed(list(enumerate(there))) if name}
    return np.array([first.get(name, -1) for name in here], dtype=int)


def labels(cells: Sequence[object]) -> list[str]:
    """Names as they are compared: ``P[07]`` is p7, 12.0 is 12."""
    told = []
    for cell in cells:
        text = "" if RawTable.is_gap(cell) else _BESIDE.sub("", str(cell)).casefold()
        text = text.removesuffix(".0")
        told.append(_NUMBER.sub(lambda found: str(int(found[0])), text))
    return told


def _ways(names: list[str], others: list[str]):
    """The names, without the number of the reading, and by their numbers alone."""
    yield names, others
    yield [_AGAIN.sub("", name) for name in names], others
    if (here := _counts(names)) and (there := _counts(others)):
        yield here, there


def _counts(names: list[str]) -> list[str]:
    """The number of every name, where they differ in one number behind one word alone."""
    parts = [re.fullmatch(r"(\D*)(\d+)", name) for name in names]
    words = {part[1] for part in parts if part}
    return [part[2] for part in parts] if len(words) == 1 and all(parts) else []


def _refuse_doubled(joints: RawTable, key: str, names: list[str]) -> None:
    """Raise where one name has joints that are not the same."""
    count, q = Counter(name for name in names if name), joint_values(joints)
    apart = []
    for name in (each for each in count if count[each] > 1):
        rows = [row for row, each in enumerate(names) if each == name]
        if q.shape[1] == 0 or np.ptp(q[rows], axis=0).max() > STILL_RAD:
            apart += rows
    if apart:
        where = f"{joints.path}: column {key}, {joints.rows_in_words(np.array(apart))}"
        what = "a name stands for several rows of joints"
        raise InputError(Problem(where, what, "one name for every pose"))


def joint_values(joints: RawTable) -> np.ndarray:
    """Joints (n, k) of a file in rad, by the unit they state or that their size speaks for."""
    from kinacc.measurements.column_names import name_of
    from kinacc.measurements.intake import columns

    units = joints.under or ("",) * len(joints.columns)
    names = [name_of(c, u) for c, u in zip(joints.columns, units, strict=False)]
    found = columns.recognise(names, lambda n: numbers(joints, n.column, [], gaps=True))
    if not found.joints:
        return np.empty((len(joints), 0))
    q = np.stack([numbers(joints, n.column, [], gaps=True) for n in found.joints], axis=1)
    unit = found.joints[0].unit
    small = np.nanmax(np.abs(q), initial=0.0) < 2.1 * np.pi
    return q if unit == "rad" or (not unit and small) else np.deg2rad(q)


def by_time(points: RawTable, joints: RawTable, how: Join) -> tuple[np.ndarray, np.ndarray]:
    """Row of the joints (n,) next in time to every point, -1 for none; and where the arm moved."""
    problems: list[Problem] = []
    here = seconds(points, how.key_of_points, problems) + how.clock_offset_s
    there = seconds(joints, how.key, problems)
    refuse(problems)
    q = joint_values(joints)
    row, moving = np.full(len(here), -1), np.zeros(len(here), dtype=bool)
    for point, time in enumerate(here):
        apart = np.abs(there - time)
        near = np.flatnonzero(apart <= how.within_s)
        if near.size and np.ptp(q[near], axis=0).max(initial=0.0) > STILL_RAD:
            moving[point] = True
        elif near.size:
            row[point] = near[np.argmin(apart[near])]
    return row, moving
