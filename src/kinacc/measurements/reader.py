"""Measured poses of a file, checked and converted once to millimetres and radians."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from kinacc.config.measured import QUATERNION, JointsFile
from kinacc.config.records import Settings
from kinacc.errors import InputError, Problem, input_error, refuse
from kinacc.kinematics.model import PAYLOAD_COLUMNS
from kinacc.kinematics.robot import Robot
from kinacc.measurements import faults
from kinacc.measurements.files import load
from kinacc.measurements.joining import AGAIN, joined
from kinacc.measurements.layout import TABLE, FileColumns, Layout, Place, Target, find
from kinacc.measurements.orientation import quaternions
from kinacc.measurements.row_names import RowNames
from kinacc.measurements.table import RawTable, numbers
from kinacc.tables.columns import Columns

POSITION = ("x_mm", "y_mm", "z_mm")
UNCERTAINTY = ("std_x_mm", "std_y_mm", "std_z_mm")
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
    unused: tuple[str, ...]
    notes: tuple[str, ...]
    commanded: np.ndarray | None
    turns: np.ndarray
    row_names: RowNames

    def left_out(self) -> list[str]:
        """All that was not used, in words."""
        unused = [f"columns not used: {', '.join(self.unused)}"] if self.unused else []
        return [*unused, *self.notes]


def read(section: Settings, robot: Robot, strict: bool = True) -> MeasuredFile:
    """Measurements of the file that ``section`` (``measurements.file``) names.

    ``strict``: joints outside their limits and readings that are there twice are refused too.
    Raises InputError listing everything that is wrong with the file.
    """
    table = _loaded(section)
    used = ~np.isin(table.line, [*excluded_lines(section)])
    return convert(table.select(used), Layout.of(section), robot, strict)


def read_excluded(section: Settings, robot: Robot) -> MeasuredFile | None:
    """The rows that ``section`` excludes, as far as they can be read; None where no row can be.

    Raises InputError where the file itself cannot be read.
    """
    table = _loaded(section)
    layout, readable = Layout.of(section), []
    for line in table.line[np.isin(table.line, [*excluded_lines(section)])]:
        with suppress(InputError):
            convert(table.select(table.line == line), layout, robot, strict=False)
            readable.append(line)
    rows = np.isin(table.line, readable)
    return convert(table.select(rows), layout, robot, strict=False) if readable else None


def excluded_lines(section: Settings) -> dict[int, str]:
    """The lines that ``section`` (``measurements.file``) excludes, each with its reason."""
    return {line: item["reason"] for item in section.get("exclude", ()) for line in item["lines"]}


def _loaded(section: Settings) -> RawTable:
    """The whole file. Raises InputError where it excludes lines that hold no reading."""
    table = load(section["path"], Layout.of(section))
    excluded, where = excluded_lines(section), "measurements.file.exclude"
    if absent := sorted(set(excluded) - set(table.line.tolist())):
        message = f"no reading in lines {', '.join(map(str, absent))}"
        allowed = f"lines {table.line[0]} to {table.line[-1]} of {table.path}"
        raise input_error(where, message, allowed)
    if len(excluded) == len(table):
        raise input_error(where, f"every row of {table.path} is excluded", "some of them")
    joints = section.get("joints") or {}
    if not joints.get("path"):
        return table
    of_joints = {**section, "exclude": (), "source": None, "layout": TABLE, **joints, "joints": {}}
    return joined(table, _loaded(of_joints), JointsFile.model_construct(**joints))


def convert(table: RawTable, layout: Layout, robot: Robot, strict: bool = True) -> MeasuredFile:
    """Measurements of a table as read; see ``read``. Raises InputError listing every problem."""
    problems: list[Problem] = []
    title = f"{table.path} cannot be used"
    columns = find(table, layout, robot.dh.prismatic, problems)
    refuse(problems, title)
    if "pose" in columns.single and not table.row_names.pose:
        table = table.with_pose_names(columns.single["pose"].column)
    q_rad = stacked(table, columns.joints, problems)
    commanded = stacked(table, columns.commanded, problems) if columns.commanded else None
    shared = _shared(table, columns, layout, problems)
    shared |= {f"q{i + 1}": values for i, values in enumerate(q_rad.T)}
    parts = [_target(table, target, layout, problems) for target in columns.targets]
    there, void = (np.array([part.pop(key) for part in parts]) for key in ("there", "void"))
    posed, measured = np.isfinite(q_rad).all(axis=1), there.any(axis=0)
    missing = measured & ~posed
    if missing.sum() > _MOST_WITHOUT_JOINTS * measured.sum() and not problems:
        message = f"empty beside {missing.sum()} of {measured.sum()} points"
        allowed = "joints in every row"
        problems += faults.of_rows(table, columns.joints, missing, message, allowed)
    without = {"no reading": posed & ~measured}
    for target, half in zip(columns.targets, void & posed & measured, strict=True):
        without[f"no reading of {target.name}"] = half
    without["not all joints"] = ~posed
    notes = [
        f"{rows.sum()} {'rows hold' if rows.sum() > 1 else 'row holds'} {quantity}: "
        f"{table.rows_in_words(rows)}"
        for quantity, rows in without.items()
        if rows.any()
    ]
    there &= posed
    if not there.any() and not problems:
        problems.append(Problem(table.path, "no target was measured in any row", "positions"))
    if strict:
        problems += faults.limit_problems(table, q_rad, robot, columns.joints)
    # One after the other: all targets of a row of the file.
    rows = pd.concat([pd.DataFrame(part | shared)[read] for part, read in
                      zip(parts, there, strict=True)]).sort_index(kind="stable")  # fmt: skip
    order = rows.index.to_numpy()
    keys = ["pose", "target"]
    if "repeat" not in columns.single:
        rows["repeat"] = rows.groupby(keys, sort=False).cumcount()
    elif "pose" in columns.single and strict:
        again = rows.duplicated([*keys, "repeat"])
        if again.any():
            first = rows[again].iloc[0]
            where = f"{table.path}: {table.rows_in_words(np.unique(order[again]))}"
            message = f"pose {first['pose']}, repeat {first['repeat']} is given again"
            problems.append(Problem(where, message, "one row per pose, repeat and target"))
    turns = rows.filter(like="turn ")
    readings = {name: rows[name].to_numpy() for name in rows if name not in turns}
    readings["row"] = table.line[order]
    readings |= table.row_names.columns(readings["row"])
    refuse(problems, title)
    unused = tuple(name for name in columns.unused(table) if name != table.key)
    commanded = None if commanded is None else commanded[order]
    return MeasuredFile(
        readings, unused, (*table.notes, *notes), commanded, turns.to_numpy(), table.row_names
    )


def stacked(
    table: RawTable, places: Sequence[Place], problems: list[Problem], gaps: bool = True
) -> np.ndarray:
    """Columns (n, len(places)) in our units, NaN where a cell is empty, if ``gaps`` are allowed."""
    columns = [numbers(table, p.column, problems, gaps=gaps) * p.factor for p in places]
    return np.stack(columns, axis=1)


def _whole_rows(table: RawTable, places: Sequence[Place], problems: list[Problem]) -> np.ndarray:
    """Columns as ``stacked``; rows of which some cells alone are empty are a problem."""
    cells = np.stack([table.gaps(place.column) for place in places], axis=1)
    partly = np.array(cells.any(axis=1) & ~cells.all(axis=1))
    message = "some of them are empty"
    problems += faults.of_rows(table, places, partly, message, "all of them, or none")
    return stacked(table, places, problems)


def _target(
    table: RawTable, target: Target, layout: Layout, problems: list[Problem]
) -> dict[str, Any]:
    """Columns (n,) of a target; ``there``: it was measured, ``void``: half of it was."""
    position = stacked(table, target.position, problems)
    gaps = np.isnan(position)
    void = gaps.any(axis=1) & ~gaps.all(axis=1)
    factors = np.array([place.factor for place in target.position])
    for number in layout.no_reading:
        void |= faults.none_read(np.where(position == number * factors, number, np.nan), number)
    is_quaternion = layout.orientation.kind == "quaternion"
    turn = np.full((len(table), 4 if is_quaternion else 3), np.nan)
    if target.turn:
        turn = _whole_rows(table, target.turn, problems)
        if is_quaternion:
            problems += faults.quaternion_problems(table, turn, target.turn)
    std = np.full((len(table), 3), np.nan)
    if target.std:
        std = stacked(table, target.std, problems) / layout.sigma
    for place, values in zip(target.std, std.T, strict=False):
        message, stated = "standard deviation {:g}", values / place.factor
        problems += faults.of_rows(table, [place], stated < 0.0, message, "0 or above", stated)
    std = np.where(std > 0.0, std, np.nan)  # a zero states nothing
    part = {"there": ~gaps.all(axis=1) & ~void, "void": void, "target": target.name}
    values = np.hstack([position, quaternions(turn, layout.orientation), std, turn])
    turned = [f"turn {number}" for number in range(turn.shape[1])]
    names = (*POSITION, *QUATERNION, *UNCERTAINTY, *turned)
    return part | dict(zip(names, values.T, strict=True))


def _shared(
    table: RawTable, columns: FileColumns, layout: Layout, problems: list[Problem]
) -> dict[str, np.ndarray]:
    """Columns (n,) that the targets of a row have in common; without poses every row is one."""
    count, single = len(table), columns.single
    shared = {"pose": np.arange(count)}
    if "temperature" in single:
        shared["temperature_c"] = numbers(table, single["temperature"].column, problems, gaps=True)
    for name in ("session", "target"):
        if name in single:
            shared[name] = _labels(table, single[name], problems)
    if "repeat" in single:
        shared["repeat"] = _whole(table, single["repeat"], problems)
    if "pose" in single and np.isfinite(table.values(single["pose"].column)).any():
        shared["pose"] = _whole(table, single["pose"], problems)
    elif "pose" in single:
        poses = pd.Series(_labels(table, single["pose"], problems))
        poses = poses.str.replace(AGAIN, "", regex=True) if layout.repeats_in_names else poses
        shared["pose"] = pd.factorize(poses)[0]
    if "session" in single and "pose" in single:  # every session may count its poses from 0
        counted = pd.MultiIndex.from_arrays([shared["session"], shared["pose"]])
        shared["pose"] = pd.factorize(counted)[0]
    ways = travel(table, columns, problems).astype(np.int8)
    shared |= {f"s{joint}": values for joint, values in enumerate(ways.T, 1)}
    if columns.payload:
        load = payload(table, columns, problems)
        shared |= dict(zip(PAYLOAD_COLUMNS, load.T, strict=True))
    return shared


def travel(table: RawTable, columns: FileColumns, problems: list[Problem]) -> np.ndarray:
    """Directions of travel (n, k) of the joints: -1, 1, or 0 where the file states none."""
    directions = np.zeros((len(table), len(columns.joints)))
    for joint, place in columns.directions.items():
        values = np.nan_to_num(numbers(table, place.column, problems, gaps=True))
        bad = ~np.isin(values, (-1, 0, 1))
        problems += faults.of_rows(table, [place], bad, "{:g}", "-1, 0 or 1", values)
        directions[:, joint] = np.where(bad, 0, values)
    return directions


def payload(
    table: RawTable, columns: FileColumns, problems: list[Problem], gaps: bool = True
) -> np.ndarray:
    """Mass and centre (n, 4) of the payload in kg and mm; a mass alone hangs at the last frame."""
    read = _whole_rows if gaps else partial(stacked, gaps=False)
    load = read(table, columns.payload, problems)
    mass, message = load[:, 0], "a mass of {:g} kg"
    problems += faults.of_rows(table, columns.payload[:1], mass < 0.0, message, "0 or above", mass)
    return load if load.shape[1] > 1 else load * np.array([1.0, 0.0, 0.0, 0.0])


def _labels(table: RawTable, place: Place, problems: list[Problem]) -> np.ndarray:
    empty = table.gaps(place.column)
    problems += faults.of_rows(table, [place], empty, "is empty", "a name in every row")
    return np.array(table.texts(place.column), dtype=object)


def _whole(table: RawTable, place: Place, problems: list[Problem]) -> np.ndarray:
    """Whole numbers (n,)."""
    values = numbers(table, place.column, problems)
    bad = np.isfinite(values) & ((values < 0) | (values > _LARGEST_WHOLE) | (values % 1 != 0))
    problems += faults.of_rows(table, [place], bad, "{:g}", "whole numbers from 0", values)
    return np.where(np.isfinite(values) & ~bad, values, 0).astype(np.int64)
