"""Joints of one file put beside the points of another: by a name, by time, or by order."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from kinacc.config.measured import JointsFile
from kinacc.errors import Problem, first_few, input_error, refuse
from kinacc.measurements.intake import columns
from kinacc.measurements.table import RawTable
from kinacc.measurements.times import STILL_RAD, seconds

NAME, TIME, ORDER = "name", "time", "order"
AGAIN = re.compile(r"(?<=\d)[_-]\d+$")  # P12_1, P12-2: the readings of P12
_NUMBER = re.compile(r"(?<!\d)\d{1,100}(?!\d)")  # longer ones number nothing
_BESIDE = re.compile(r"[\s\[\](){}\"']+")
_PREFIX = "joints file "  # before columns of the joints' file whose name the points' file has too


def joined(points: RawTable, joints: RawTable, how: JointsFile) -> RawTable:
    """Rows of the points with the joints beside them, under the lines of the points.

    ``notes`` of the table name the rows without a partner. Raises InputError where keys are
    missing, doubled with other joints, or match nothing.
    """
    key, key_of_points = how.key or "", how.key_of_points or ""
    keys = (("key", key, joints), ("key_of_points", key_of_points, points))
    refuse(
        Problem(f"measurements.file.joints.{ours}", f"{table.path} has no column {name}")
        for ours, name, table in keys
        if how.by != ORDER and name not in table.columns
    )
    if how.by == ORDER and len(points) != len(joints):
        message = f"{len(points)} rows, and {len(joints)} rows of joints in {joints.path}"
        raise input_error(points.path, message, "as many of both to join them by order")
    moving = np.zeros(len(points), dtype=bool)
    if how.by == NAME:
        row = rows_by_name(points, joints, key, key_of_points)
    elif how.by == TIME:
        row, moving = _rows_by_time(points, joints, how)
    else:
        row = np.arange(len(points))
    there = row >= 0
    if not there.any():
        message = f"no row belongs to any of {joints.path}, joined by {how.by}"
        raise input_error(points.path, message, fix="correct measurements.file.joints")
    notes = [_left_out(points, (row < 0) & ~moving, key_of_points, joints)]
    if how.by == NAME:
        notes.append(_left_out(joints, ~np.isin(np.arange(len(joints)), row), key, points))
        points = points.with_pose_names(key_of_points)
    if moving.any():
        lines = points.rows_in_words(moving)
        notes.append(f"{points.path}: left out, the arm was moving: {lines}")
    beside = joints.columns.iloc[row[there]].reset_index(drop=True)
    if (joints.decimal, joints.thousands) != (points.decimal, points.thousands):
        # Cells are numbers of their own file.
        marks = str.maketrans({joints.thousands or "\0": "", joints.decimal: points.decimal})
        beside = beside.map(lambda cell: cell.translate(marks) if isinstance(cell, str) else cell)
    names = {name: beside_name(name, points) for name in beside}
    table = points.select(there)
    return replace(
        table,
        columns=pd.concat([table.columns, beside.rename(columns=names)], axis=1),
        units={**{names[n]: u for n, u in joints.units.items()}, **points.units},
        notes=(*points.notes, *joints.notes, *filter(None, notes)),
        row_names=replace(points.row_names, file=Path(points.path).name),
        key=key_of_points or None,
    )


def beside_name(column: str, points: RawTable) -> str:
    """The name of a column of the joints' file beside the points."""
    return f"{_PREFIX}{column}" if column in points.columns else column


def _left_out(table: RawTable, rows: np.ndarray, key: str, partner: RawTable) -> str:
    """A note on the rows where ``rows`` (n,) is True, with their keys; empty for none."""
    if not rows.any():
        return ""
    lines = table.rows_in_words(rows)
    keys = f", {key} {first_few([*table.columns[key][rows]])}" if key else ""
    return f"{table.path}: left out, without a partner in {partner.path}: {lines}{keys}"


def rows_by_name(points: RawTable, joints: RawTable, key: str, key_of_points: str) -> np.ndarray:
    """Row of the joints (n,) of the same name in ``key`` as every point, -1 for none.

    Raises InputError where one name has joints that are not the same.
    """
    here, there = labels(points.columns[key_of_points]), labels(joints.columns[key])
    ways = [(here, there), ([AGAIN.sub("", name) for name in here], there)]
    if (counts := _counts(here)) and (others := _counts(there)):
        ways.append((counts, others))
    here, there = max(ways, key=lambda way: sum(name in {*way[1]} for name in way[0]))
    names = pd.Series(there)
    q = pd.DataFrame(joint_values(joints)).groupby(names)
    apart = (q.transform("max") - q.transform("min")).max(axis=1).fillna(np.inf) > STILL_RAD
    doubled = (names.duplicated(keep=False) & (names != "") & apart).to_numpy()
    if doubled.any():
        message = "a name stands for several rows of joints"
        raise input_error(joints.where(key, doubled), message, "a name for every pose")
    first = names[~names.duplicated() & (names != "")]
    return pd.Series(first.index, index=first).reindex(here).fillna(-1).to_numpy(int)


def labels(cells: Iterable[object]) -> list[str]:
    """Names as they are compared: ``P[07]`` is p7, 12.0 is 12."""
    texts = ("" if RawTable.is_gap(c) else _BESIDE.sub("", str(c)).casefold() for c in cells)
    return [_NUMBER.sub(lambda n: str(int(n[0])), text.removesuffix(".0")) for text in texts]


def _counts(names: list[str]) -> list[str]:
    """The number of every name, where they differ in one number behind one word alone."""
    parts = pd.Series(names).str.extract(r"^(\D*)(\d+)$")
    return parts[1].tolist() if parts[1].notna().all() and parts[0].nunique() == 1 else []


def joint_values(joints: RawTable) -> np.ndarray:
    """Joints (n, k) of a file in rad, by the unit they state or that their size shows."""
    names = columns.of_table(joints).joints
    if not names:
        return np.full((len(joints), 1), np.inf)
    q = joints.stacked(name.column for name in names)
    small = np.nanmax(np.abs(q), initial=0.0) < 2.1 * np.pi
    return q if names[0].unit == "rad" or (not names[0].unit and small) else np.deg2rad(q)


def _rows_by_time(
    points: RawTable, joints: RawTable, how: JointsFile
) -> tuple[np.ndarray, np.ndarray]:
    """Row of the joints (n,) next in time to every point, -1 for none; and where the arm moved."""
    here = seconds(points, how.key_of_points or "") + how.clock_offset_s
    there = seconds(joints, how.key or "")
    q = joint_values(joints)
    row, moving = np.full(len(here), -1), np.zeros(len(here), dtype=bool)
    for point, time in enumerate(here):
        apart = np.abs(there - time)
        near = np.flatnonzero(apart <= how.within_s)
        if near.size:
            moving[point] = np.ptp(q[near], axis=0).max() > STILL_RAD
            row[point] = -1 if moving[point] else near[np.argmin(apart[near])]
    return row, moving
