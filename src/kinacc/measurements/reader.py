"""Measured poses of a file, checked and converted once to millimetres and radians."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from kinacc.errors import InputError, Problem, gathered, refuse
from kinacc.kinematics.model import PAYLOAD_COLUMNS
from kinacc.kinematics.robot import Robot
from kinacc.measurements import faults
from kinacc.measurements.faults import at
from kinacc.measurements.files import load
from kinacc.measurements.layout import (
    STD,
    TABLE,
    FoundColumns,
    Join,
    Layout,
    Place,
    Target,
    find,
)
from kinacc.measurements.orientation import quaternions, rotation_std
from kinacc.measurements.row_names import RowNames
from kinacc.measurements.table import RawTable, numbers
from kinacc.tables.columns import Columns

POSITION = ("x_mm", "y_mm", "z_mm")
QUATERNION = ("qw", "qx", "qy", "qz")
UNCERTAINTY = (
    *(f"{name}_mm" for name in STD),
    *("corr_xy", "corr_xz", "corr_yz"),
    *("std_rx_rad", "std_ry_rad", "std_rz_rad"),
)
AGAIN = re.compile(r"(?<=\d)[_-]\d+$")  # P12_1, P12-2: the readings of P12
_LARGEST_WHOLE = 2.0**53  # beyond, neighbours are the same number
_MOST_WITHOUT_JOINTS = 0.2  # of the points; beyond, joints may stand for the rows below them


@dataclass(frozen=True)
class MeasuredFile:
    """What a file holds.

    ``columns`` of the measurements artefact but fold and subset, one row per reading of a target;
    ``unused`` columns of the file; ``notes`` say what else was left out, with its lines. For the
    checks: ``commanded`` (rows, k) the joints as commanded, None where the file does not say;
    ``turns`` (rows, 3 or 4) the orientations as written, in rad, NaN where there is none.
    ``row_names`` say what its rows are called.
    """

    columns: Columns
    unused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    commanded: np.ndarray | None = None
    turns: np.ndarray | None = None
    row_names: RowNames = field(default_factory=RowNames)

    def left_out(self) -> list[str]:
        """All that was not used, in words."""
        unused = [f"columns not used: {', '.join(self.unused)}"] if self.unused else []
        return [*unused, *self.notes]


def read(section: Mapping, robot: Robot, strict: bool = True) -> MeasuredFile:
    """Measurements of the file that ``section`` (``measurements.file``) names.

    ``strict``: values that cannot be meant (joints outside their limits, metres taken for
    millimetres) are refused too, and so are readings that are there twice. Raises InputError
    listing everything that is wrong with the file.
    """
    table = _loaded(section)
    used = np.flatnonzero(~np.isin(table.line, list(excluded_lines(section))))
    table = table if used.size == len(table) else table.select(used)
    return convert(table, Layout.of(section), robot, strict)


def read_excluded(section: Mapping, robot: Robot) -> tuple[MeasuredFile | None, list[Problem]]:
    """The rows that ``section`` excludes, as far as they can be read, and what of them cannot.

    None where no row can be. Raises InputError where the file itself cannot be read.
    """
    table = _loaded(section)
    layout, readable, problems = Layout.of(section), [], []
    for row in np.flatnonzero(np.isin(table.line, list(excluded_lines(section)))):
        with gathered(problems):
            convert(table.select(np.array([row])), layout, robot, strict=False)
            readable.append(row)
    if not readable:
        return None, problems
    return convert(table.select(np.array(readable)), layout, robot, strict=False), problems


def excluded_lines(section: Mapping) -> dict[int, str]:
    """The lines that ``section`` (``measurements.file``) excludes, each with its reason."""
    return {line: item["reason"] for item in section.get("exclude", ()) for line in item["lines"]}


def _loaded(section: Mapping) -> RawTable:
    """The whole file. Raises InputError where it excludes lines that hold no reading."""
    table = load(section["path"], Layout.of(section), section.get("source"))
    excluded, where = excluded_lines(section), "measurements.file.exclude"
    absent = sorted(set(excluded) - set(table.line.tolist()) - set(table.not_rows))
    if absent:
        what = f"line{'s' if len(absent) > 1 else ''} {', '.join(map(str, absent))} hold no reading"
        allowed = f"lines {table.line[0]} to {table.line[-1]} of {table.path}"
        raise InputError(Problem(where, what, allowed))
    if len(excluded) == len(table):
        raise InputError(Problem(where, f"every row of {table.path} is excluded", "some of them"))
    joints = section.get("joints") or {}
    if not joints.get("path"):
        return table
    from kinacc.measurements.joining import joined

    own = {**section, "exclude": (), "source": None, "layout": TABLE, **joints, "joints": None}
    return joined(table, _loaded(own), Join.of(joints))


def convert(table: RawTable, layout: Layout, robot: Robot, strict: bool = True) -> MeasuredFile:
    """Measurements of a table as read; see ``read``. Raises InputError listing every problem."""
    problems: list[Problem] = []
    title = f"{table.path} cannot be used"
    found = find(table, layout, robot.dh.prismatic, problems)
    refuse(problems, title)
    if not found.targets:
        problems.append(Problem(table.path, "no target is asked for", "measurements.file.targets"))
        raise InputError(problems, title)
    if "pose" in found.single and not table.pose_name:
        table = table.with_pose_names(found.single["pose"].column)
    q_rad = _stacked(table, found.joints, problems)
    commanded = _stacked(table, found.commanded, problems) if found.commanded else None
    shared = _shared(table, found, layout, problems)
    shared |= {f"q{i + 1}": values for i, values in enumerate(q_rad.T)}
    parts = [_target(table, target, layout, problems) for target in found.targets]
    posed = np.isfinite(q_rad).all(axis=1)
    problems += [] if problems else _without_joints(table, found, posed, parts)
    notes = (*table.notes, *_not_read(table, parts, posed))
    there = [part.pop("there") & posed for part in parts]
    if not np.any(there) and not problems:
        problems.append(Problem(table.path, "no target was measured in any row", "positions"))
    if strict:
        problems += faults.limit_problems(table, q_rad, robot, found.joints)
    rows = [pd.DataFrame(shared | part)[own] for part, own in zip(parts, there, strict=True)]
    # One after the other: all targets of a row of the file.
    rows = pd.concat(rows).sort_index(kind="stable")
    order = rows.index.to_numpy()
    if "label" in rows:
        rows["target"] = rows.pop("label")
    keys = ["pose", "target"]
    if "repeat" not in found.single:
        rows["repeat"] = rows.groupby(keys, sort=False).cumcount()
    elif "pose" in found.single and strict:
        again = rows.duplicated([*keys, "repeat"])
        if again.any():
            one = rows[again].iloc[0]
            where = f"{table.path}: {table.rows_in_words(np.unique(order[again]))}"
            what = f"pose {one['pose']}, repeat {one['repeat']} is given again"
            problems.append(Problem(where, what, "one row per pose, repeat and target"))
    turns = rows.filter(like="turn ").to_numpy()
    rows = rows.drop(columns=rows.filter(like="turn ").columns)
    columns = {name: rows[name].to_numpy() for name in rows}
    columns["row"] = table.line[order]
    columns |= table.row_names.columns(columns["row"])
    if strict and not problems:
        problems += faults.scale_problems(table, columns, robot)
    refuse(problems, title)
    unused = tuple(name for name in found.unused(table) if name != table.key)
    commanded = commanded if commanded is None else commanded[order]
    return MeasuredFile(columns, unused, notes, commanded, turns, table.row_names)


def _not_read(table: RawTable, parts: list[dict], posed: np.ndarray) -> list[str]:
    """What is left out of the rows, in words: those without joints, and points that are none."""

    def told(rows: np.ndarray, what: str) -> list[str]:
        count = int(rows.sum())
        hold = "rows hold" if count > 1 else "row holds"
        words = table.rows_in_words(np.flatnonzero(rows))
        return [f"{count} {hold} {what}: {words}"] if count else []

    nothing = ~np.any([part["there"] for part in parts], axis=0)
    notes = told(posed & nothing, "no reading")
    for part in parts:
        notes += told(part.pop("void") & posed & ~nothing, f"no reading of {part['target'][0]}")
    return notes + told(~posed, "no joints" if nothing[~posed].all() else "not all joints")


def _without_joints(
    table: RawTable, found: FoundColumns, posed: np.ndarray, parts: list[dict]
) -> list[Problem]:
    """Joints that are missing beside so many points that it can be no gap."""
    points = np.any([part["there"] for part in parts], axis=0)
    missing = np.flatnonzero(points & ~posed)
    if len(missing) <= _MOST_WITHOUT_JOINTS * points.sum():
        return []
    what = f"empty beside {len(missing)} of {points.sum()} points"
    return [at(table, found.joints, missing, what, "joints in every row")]


def _stacked(table: RawTable, places: Sequence[Place], problems: list[Problem]) -> np.ndarray:
    """Columns (n, len(places)) in our units, NaN where a cell is empty."""
    columns = [numbers(table, p.column, problems, gaps=True) * p.factor for p in places]
    return np.stack(columns, axis=1)


def _refuse_parts(table: RawTable, places: tuple[Place, ...], problems: list[Problem]) -> None:
    """Note rows in which some of the columns are empty and others are not."""
    cells = np.stack([table.gaps(place.column) for place in places], axis=1)
    partly = cells.any(axis=1) & ~cells.all(axis=1)
    if partly.any():
        problems.append(at(table, places, partly, "some of them are empty", "all of them, or none"))


def _target(table: RawTable, target: Target, layout: Layout, problems: list[Problem]) -> dict:
    """Columns (n,) of one target; ``there``: it was measured, ``void``: half of it was."""
    position = _stacked(table, target.position, problems)
    gaps = np.isnan(position)
    void = gaps.any(axis=1) & ~gaps.all(axis=1)
    factors = np.array([place.factor for place in target.position])
    for number in layout.no_reading:
        void |= faults.none_read(np.where(position == number * factors, number, np.nan), number)
    part = {"there": ~gaps.all(axis=1) & ~void, "void": void, "target": [target.name] * len(table)}
    quaternion = layout.orientation == "quaternion"
    turn = np.full((len(table), 4 if quaternion else 3), np.nan)
    if target.turn:
        _refuse_parts(table, target.turn, problems)
        turn = _stacked(table, target.turn, problems)
        if quaternion:
            problems += faults.quaternion_problems(table, turn, target.turn)
    part |= dict(zip(POSITION, position.T, strict=True))
    turned = quaternions(turn, layout) if target.turn else np.full((len(table), 4), np.nan)
    part |= dict(zip(QUATERNION, turned.T, strict=True))
    part |= _uncertainty(table, target, turn, layout, problems)
    return part | {f"turn {number}": values for number, values in enumerate(turn.T)}


def _uncertainty(table, target: Target, turn: np.ndarray, layout: Layout, problems) -> dict:
    """Standard deviations and correlations (n,) of a target, NaN where the file has none."""

    def spread(places: Sequence[Place]) -> np.ndarray:
        std = _stacked(table, places, problems) / layout.sigma
        for place, values in zip(places, std.T, strict=True):
            bad = np.flatnonzero(values < 0.0)
            if bad.size:
                what = f"standard deviation {values[bad[0]] / place.factor:g}"
                problems.append(at(table, [place], bad, what, "0 or above"))
        return np.where(std > 0.0, std, np.nan)  # a zero says nothing

    values = np.full((9, len(table)), np.nan)
    if target.std:
        values[:3] = spread(target.std).T
    if target.covariance:
        elements = _stacked(table, target.covariance, problems)
        matrix = elements[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
        problems += faults.covariance_problems(table, matrix, target.covariance)
        with np.errstate(invalid="ignore"):
            values[:3] = np.sqrt(elements[:, [0, 3, 5]]).T
            values[3:6] = elements[:, [1, 2, 4]].T / values[[0, 0, 1]] / values[[1, 2, 2]]
    if target.std_turn and target.turn and layout.orientation != "quaternion":
        std = spread(target.std_turn)
        axes = layout.convention.lower()
        if layout.orientation == "euler" and len({*axes}) == 3:
            std = std[:, ["xyz".index(axis) for axis in axes]]
        there = np.isfinite(turn).all(axis=1) & np.isfinite(std).all(axis=1)
        values[6:, there] = rotation_std(turn[there], std[there], layout).T
    return dict(zip(UNCERTAINTY, values, strict=True))


def _shared(table: RawTable, found: FoundColumns, layout: Layout, problems: list[Problem]) -> dict:
    """Columns (n,) that the targets of a row have in common; without poses every row is one."""
    count, single = len(table), found.single
    shared: dict = {
        "pose": np.arange(count),
        "repeat": np.zeros(count, dtype=np.int64),
        "session": np.full(count, None, dtype=object),
        "temperature_c": np.full(count, np.nan),
    }
    if "temperature" in single:
        shared["temperature_c"] = numbers(table, single["temperature"].column, problems, gaps=True)
    if "session" in single:
        shared["session"] = _labels(table, single["session"], problems)
    for name in ("pose", "repeat"):
        if name in single:
            again = layout.repeats_in_names and name == "pose"
            shared[name] = _whole(table, single[name], problems, name == "pose", again)
    if "session" in single and "pose" in single:  # every session may count its poses from 0
        shared["pose"] = pd.factorize(pd.MultiIndex.from_arrays(
            [shared["session"], shared["pose"]]))[0]  # fmt: skip
    for joint in range(len(found.joints)):
        s = np.zeros(count, dtype=np.int8)
        if place := found.directions.get(joint):
            values = numbers(table, place.column, problems, gaps=True)
            bad = np.flatnonzero(np.isfinite(values) & ~np.isin(values, (-1, 0, 1)))
            if bad.size:
                problems.append(at(table, [place], bad, f"{values[bad[0]]:g}", "-1, 0 or 1"))
            s = np.where(np.isin(values, (-1, 0, 1)), values, 0).astype(np.int8)
        shared[f"s{joint + 1}"] = s
    if found.payload:
        _refuse_parts(table, found.payload, problems)
        load = _stacked(table, found.payload, problems)
        if (load[:, 0] < 0.0).any():
            what = f"a mass of {load[:, 0].min():g} kg"
            problems.append(at(table, found.payload[:1], load[:, 0] < 0.0, what, "0 or above"))
        # A mass alone hangs at the last DH frame.
        load = load if len(found.payload) > 1 else load * np.array([1.0, 0.0, 0.0, 0.0])
        shared |= dict(zip(PAYLOAD_COLUMNS, load.T, strict=True))
    if "target" in single:
        shared["label"] = _labels(table, single["target"], problems)
    return shared


def _labels(table: RawTable, place: Place, problems: list[Problem]) -> np.ndarray:
    empty = table.gaps(place.column)
    if empty.any():
        problems.append(at(table, [place], empty, "is empty", "a name in every row"))
    return np.array([*table.texts(place.column), None], dtype=object)[:-1]


def _whole(table: RawTable, place: Place, problems: list, words: bool, again: bool) -> np.ndarray:
    """Whole numbers (n,); with ``words``, names are numbered as they first appear.

    ``again``: a number behind a name counts the readings of one pose.
    """
    if words and not np.isfinite(table.values(place.column)).any():
        labels = [AGAIN.sub("", each) if again else each for each in
                  _labels(table, place, problems)]  # fmt: skip
        return pd.factorize(np.array(labels, dtype=object))[0]
    values = numbers(table, place.column, problems)
    wrong = (values < 0) | (values > _LARGEST_WHOLE) | (values % 1 != 0)
    bad = np.flatnonzero(np.isfinite(values) & wrong)
    if bad.size:
        what = f"{values[bad[0]]:g}"
        problems.append(at(table, [place], bad, what, "whole numbers from 0"))
    return np.where(np.isfinite(values) & ~wrong, values, 0).astype(np.int64)
