"""Joints of one file put beside the points of another: by a name, by time, or by order."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.measurements.layout import Join
from kinacc.measurements.reader import AGAIN
from kinacc.measurements.table import RawTable
from kinacc.measurements.times import seconds

NAME, TIME, ORDER = "name", "time", "order"
STILL_RAD = np.deg2rad(0.02)  # joints that move less stand still
_NUMBER = re.compile(r"(?<!\d)\d{1,100}(?!\d)")  # longer ones number nothing
_BESIDE = re.compile(r"[\s\[\](){}\"']+")
_OTHER = "joints file "  # before columns of the joints' file whose name the points' file has too


def joined(points: RawTable, joints: RawTable, how: Join) -> RawTable:
    """Rows of the points with the joints beside them, under the lines of the points.

    ``notes`` of the table say which rows found none. Raises InputError where keys are missing,
    doubled with other joints, or match nothing.
    """
    row, notes = pairs(points, joints, how)
    kept = np.flatnonzero(row >= 0)
    if not kept.size:
        what = f"no row belongs to any of {joints.path}, joined by {how.by}"
        raise InputError(Problem(points.path, what, fix="correct measurements.file.joints"))
    named = points.with_pose_names(how.key_of_points or "") if how.by == NAME else points
    beside = joints.select(row[kept]).columns
    marks = (joints.decimal, joints.thousands)
    if marks != (points.decimal, points.thousands):  # cells are numbers of their own file
        beside = beside.map(lambda cell: _marked(cell, *marks, points.decimal))
    names = {name: beside_name(name, points) for name in beside}
    table = named.select(kept)
    return replace(
        table,
        columns=pd.concat([table.columns, beside.rename(columns=names)], axis=1),
        units={**{names[n]: u for n, u in joints.units.items()}, **points.units},
        notes=(*points.notes, *joints.notes, *notes),
        points_file=Path(points.path).name,
        key=how.key_of_points,
    )


def beside_name(column: str, points: RawTable) -> str:
    """What a column of the joints' file is called beside the points."""
    return f"{_OTHER}{column}" if column in points.columns else column


def _marked(cell: object, decimal: str, thousands: str | None, other: str) -> object:
    if not isinstance(cell, str):
        return cell
    return cell.replace(thousands or "\0", "").replace(decimal, other)


def pairs(points: RawTable, joints: RawTable, how: Join) -> tuple[np.ndarray, tuple[str, ...]]:
    """Row of the joints (n,) of every point, -1 for none, and what is left over, in words."""
    keys = (("key", how.key, joints), ("key_of_points", how.key_of_points, points))
    refuse(
        Problem(f"measurements.file.joints.{key}", f"{table.path} has no column {name}")
        for key, name, table in keys
        if how.by != ORDER and name not in table.columns
    )
    if how.by == ORDER:
        if len(points) != len(joints):
            what = f"{len(points)} rows, and {len(joints)} rows of joints in {joints.path}"
            raise InputError(Problem(points.path, what, "as many of both to join them by order"))
        return np.arange(len(points)), ()
    if how.by == NAME:
        row = by_name(points, joints, how)
        spare = np.setdiff1d(np.arange(len(joints)), row)
        notes = _left(points, row < 0, joints, how.key_of_points)
        return row, (*notes, *_left(joints, spare, points, how.key))
    row, moving = by_time(points, joints, how)
    notes = _left(points, (row < 0) & ~moving, joints, "")
    if moving.any():
        lines = points.rows_in_words(np.flatnonzero(moving))
        notes += (f"{points.path}: the arm was moving at {lines}, which are left out",)
    return row, notes


def _left(table: RawTable, rows: np.ndarray, other: RawTable, key: str) -> tuple[str, ...]:
    """Rows of a table that the other has no partner of, by their lines and names."""
    rows = np.flatnonzero(rows) if rows.dtype == bool else rows
    if not rows.size:
        return ()
    texts = table.texts(key) if key else []
    named = f", {key} {first_few([texts[row] for row in rows])}" if key else ""
    words = f"{table.rows_in_words(rows)}{named}"
    return (f"{table.path}: left out, without a partner in {other.path}: {words}",)


def by_name(points: RawTable, joints: RawTable, how: Join) -> np.ndarray:
    """Row of the joints (n,) of the same name as every point, -1 for none."""
    names, others = labels(points.columns[how.key_of_points]), labels(joints.columns[how.key])
    ways = [(names, others), ([AGAIN.sub("", name) for name in names], others)]
    if (here := _counts(names)) and (there := _counts(others)):
        ways.append((here, there))
    here, there = max(ways, key=lambda way: len([name for name in way[0] if name in {*way[1]}]))
    _refuse_doubled(joints, how.key, there)
    first = {name: row for row, name in reversed(list(enumerate(there))) if name}
    return np.array([first.get(name, -1) for name in here], dtype=int)


def labels(cells: Sequence[object]) -> list[str]:
    """Names as they are compared: ``P[07]`` is p7, 12.0 is 12."""
    texts = ("" if RawTable.is_gap(c) else _BESIDE.sub("", str(c)).casefold() for c in cells)
    return [_NUMBER.sub(lambda n: str(int(n[0])), text.removesuffix(".0")) for text in texts]


def _counts(names: list[str]) -> list[str]:
    """The number of every name, where they differ in one number behind one word alone."""
    parts = [re.fullmatch(r"(\D*)(\d+)", name) for name in names]
    alike = all(parts) and len({part[1] for part in parts}) == 1
    return [part[2] for part in parts] if alike else []


def _refuse_doubled(joints: RawTable, key: str, names: list[str]) -> None:
    """Raise where one name has joints that are not the same."""
    q, apart = joint_values(joints), []
    for name in (each for each, count in Counter(names).items() if count > 1 and each):
        rows = [row for row, each in enumerate(names) if each == name]
        if q.shape[1] == 0 or np.ptp(q[rows], axis=0).max() > STILL_RAD:
            apart += rows
    if apart:
        what = "a name stands for several rows of joints"
        where = joints.where(key, np.array(apart))
        raise InputError(Problem(where, what, "one name for every pose"))


def joint_values(joints: RawTable) -> np.ndarray:
    """Joints (n, k) of a file in rad, by the unit they state or that their size speaks for."""
    from kinacc.measurements.intake import columns

    found = columns.of_table(joints).joints
    if not found:
        return np.empty((len(joints), 0))
    q = np.stack([joints.values(name.column) for name in found], axis=1)
    small = np.nanmax(np.abs(q), initial=0.0) < 2.1 * np.pi
    return q if found[0].unit == "rad" or (not found[0].unit and small) else np.deg2rad(q)


def by_time(points: RawTable, joints: RawTable, how: Join) -> tuple[np.ndarray, np.ndarray]:
    """Row of the joints (n,) next in time to every point, -1 for none; and where the arm moved."""
    problems = []
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
