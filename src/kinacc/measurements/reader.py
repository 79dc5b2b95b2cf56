"""Measured poses of a file, checked and converted once to millimetres and radians."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from kinacc.errors import InputError, Problem, gathered, refuse
from kinacc.kinematics.model import PAYLOAD_COLUMNS
from kinacc.kinematics.robot import Robot
from kinacc.measurements import faults
from kinacc.measurements.files import load
from kinacc.measurements.layout import STD, TOOL, FoundColumns, Layout, Place, Target, find
from kinacc.measurements.orientation import quaternions, rotation_std
from kinacc.measurements.row_names import RowNames
from kinacc.measurements.table import RawTable, numbers
from kinacc.measurements.written import TABLE, Written
from kinacc.tables.columns import Columns, texts

POSITION = ("x_mm", "y_mm", "z_mm")
QUATERNION = ("qw", "qx", "qy", "qz")
UNCERTAINTY = (
    *(f"{name}_mm" for name in STD),
    *("corr_xy", "corr_xz", "corr_yz"),
    *("std_rx_rad", "std_ry_rad", "std_rz_rad"),
)

_LARGEST_WHOLE = 2.0**53  # beyond, neighbours are the same number


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
    if used.size == len(table):
        return convert(table, Layout.of(section), robot, strict)
    return convert(table.select(used), Layout.of(section), robot, strict)


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
    table = load(section["path"], Written.of(section), section.get("source"))
    excluded = excluded_lines(section)
    absent = sorted(set(excluded) - set(table.line.tolist()) - set(table.not_rows))
    problems = []
    if absent:
        what = f"line{'s' if len(absent) > 1 else ''} {', '.join(map(str, absent))} hold no reading"
        allowed = f"lines {table.line[0]} to {table.line[-1]} of {table.path}"
        problems.append(Problem("measurements.file.exclude", what, allowed))
    elif len(excluded) == len(table):
        what = f"every row of {table.path} is excluded"
        problems.append(Problem("measurements.file.exclude", what, "some of them"))
    refuse(problems)
    joints = section.get("joints") or {}
    if not joints.get("path"):
        return table
    from kinacc.measurements.joining import Join, joined

    own = {**section, "exclude": (), "source": None, "layout": TABLE, **joints, "joints": None}
    beside = _loaded(own)
    return joined(table, beside, Join.of(joints))


def convert(table: RawTable, layout: Layout, robot: Robot, strict: bool = True) -> MeasuredFile:
    """Measurements of a table as read; see ``read``. Raises InputError listing every problem."""
    problems: list[Problem] = []
    title = f"{table.path} cannot be used"
    found = find(table, layout, robot.dh.prismatic, problems)
    problems += faults.unit_problems(table, layout, robot.dh.prismatic)
    if found is None or problems:
        raise InputError(problems, title)
    if "pose" in found.single and not table.pose_name:
        table = table.with_pose_names(found.single["pose"].column)
    q_rad = _stacked(table, found.joints, problems, gaps=True)
    commanded = _stacked(table, found.commanded, problems, gaps=True) if found.commanded else None
    shared = _numbered(table, found, problems, layout.repeats_in_names)
    s = _directions(table, found, len(found.joints), problems)
    payload = _payload(table, found.payload, problems)
    parts = [_target(table, target, layout, problems) for target in found.targets]
    if not parts:
        problems.append(
            Problem(table.path, "no target is asked for", "names in measurements.file.targets")
        )
        raise InputError(problems, title)
    posed = ~np.isnan(q_rad).any(axis=1)
    if not problems:
        problems += _without_joints(table, found, posed, parts)
    notes = [*table.notes, *_not_read(table, parts, posed)]
    for part in parts:
        part["there"] &= posed
    nothing = ~np.any([part["there"] for part in parts], axis=0)
    if nothing.all() and not problems:
        problems.append(Problem(table.path, "no target was measured in any row", "positions"))
    if strict:
        problems += faults.limit_problems(table, q_rad, robot, found.joints)
    order = np.concatenate([np.flatnonzero(part["there"]) for part in parts])
    columns = _row_columns(q_rad, s, shared, order)
    for name in ("target", *POSITION, *QUATERNION, *UNCERTAINTY):
        columns[name] = np.concatenate([part[name][part["there"]] for part in parts])
    if "target" in shared:
        columns["target"] = shared["target"][order]
    columns["row"] = table.line[order]
    columns |= table.row_names.columns(columns["row"])
    columns |= {name: values[order] for name, values in payload.items()}
    turns = np.concatenate([part["turns"][part["there"]] for part in parts])
    by_row = np.argsort(order, kind="stable")
    columns = {name: values[by_row] for name, values in columns.items()}
    order, turns = order[by_row], turns[by_row]
    if "repeat" not in found.single:
        columns["repeat"] = _count_within(columns)
    elif "pose" in found.single and strict:
        problems += _doubled(table, columns, order)
    if strict and not problems:
        problems += faults.scale_problems(table, columns, robot)
    refuse(problems, title)
    return MeasuredFile(
        columns,
        tuple(name for name in found.unused(table) if name != table.key),
        tuple(notes),
        commanded if commanded is None else commanded[order],
        turns,
        table.row_names,
    )


def _not_read(table: RawTable, parts: list[Columns], posed: np.ndarray) -> list[str]:
    """What is left out of the rows, in words: those without joints, and points that are none."""

    def told(rows: np.ndarray, of: str, what: str = "no reading") -> str:
        lines = np.flatnonzero(rows)
        count = f"{len(lines)} row{'s hold' if len(lines) > 1 else ' holds'}"
        return f"{count} {what}{of}: {table.rows_in_words(lines)}"

    nothing = ~np.any([part["there"] for part in parts], axis=0)
    notes = []
    if (posed & nothing).any():
        notes.append(told(posed & nothing, ""))
    for part in parts:
        rows = part["void"] & posed & ~nothing
        if rows.any():
            notes.append(told(rows, f" of {part['target'][0]}"))
    if not posed.all():
        notes.append(told(~posed, "", "no joints" if nothing[~posed].all() else "not all joints"))
    return notes


_MOST_WITHOUT_JOINTS = 0.2  # of the points; beyond, joints may stand for the rows below them


def _without_joints(
    table: RawTable, found: FoundColumns, posed: np.ndarray, parts: list[Columns]
) -> list[Problem]:
    """Joints that are missing beside so many points that it can be no gap."""
    points = np.any([part["there"] for part in parts], axis=0)
    missing = np.flatnonzero(points & ~posed)
    if len(missing) <= _MOST_WITHOUT_JOINTS * points.sum():
        return []
    names = ", ".join(table.column_in_words(place.column) for place in found.joints)
    where = f"{table.path}: columns {names}, {table.rows_in_words(missing)}"
    what = f"empty beside {len(missing)} of {points.sum()} points"
    fix = "fill the joints in, where they stand for the rows below them too"
    return [Problem(where, what, "joints in every row", fix)]


def _stacked(table: RawTable, places: tuple[Place, ...], problems, gaps=False) -> np.ndarray:
    """Columns (n, len(places)) in our units."""
    columns = [numbers(table, each.column, problems, gaps=gaps) * each.factor for each in places]
    return np.stack(columns, axis=1)


def _row_columns(q_rad, s, shared, order) -> Columns:
    """What the targets of a row of the file have in common."""
    columns = {"pose": shared["pose"][order]}
    columns |= {f"q{i + 1}": q_rad[order, i] for i in range(q_rad.shape[1])}
    columns |= {f"s{i + 1}": s[order, i] for i in range(s.shape[1])}
    columns["repeat"] = shared["repeat"][order]
    columns["session"] = shared["session"][order]
    columns["temperature_c"] = shared["temperature"][order]
    return columns


def _target(table: RawTable, target: Target, layout: Layout, problems) -> Columns:
    """Columns (n,) of one target, and ``there`` (n,): where it was measured."""
    count = len(table)
    position = _stacked(table, target.position, problems, gaps=True)
    gaps = np.zeros(position.shape, dtype=bool)
    for row, axis in np.argwhere(~np.isfinite(position)):  # looking at every cell takes longer
        gaps[row, axis] = table.is_gap(table.columns[target.position[axis].column][row])
    factors = np.array([place.factor for place in target.position])
    void = gaps.any(axis=1) & ~gaps.all(axis=1)
    for number in layout.no_reading:
        void |= faults.none_read(np.where(position == number * factors, number, np.nan), number)
    position[void] = np.nan
    part = {
        "there": ~gaps.all(axis=1) & ~void,
        "void": void,
        "target": np.full(count, target.name, dtype=object),
    }
    turn = np.full((count, 4 if layout.orientation == "quaternion" else 3), np.nan)
    quaternion = np.full((count, 4), np.nan)
    if target.turn:
        _refuse_parts(table, target.turn, problems)
        turn = _stacked(table, target.turn, problems, gaps=True)
        if layout.orientation == "quaternion":
            problems += faults.quaternion_problems(table, turn, target.turn)
        quaternion = quaternions(turn, layout)
    part["turns"] = turn
    part |= dict(zip(POSITION, position.T, strict=True))
    part |= dict(zip(QUATERNION, quaternion.T, strict=True))
    part |= _uncertainty(table, target, turn, layout, problems)
    return part


def _refuse_parts(table: RawTable, places: tuple[Place, ...], problems) -> None:
    """Note rows in which some of the columns are empty and others are not."""
    cells = np.stack([table.gaps(place.column) for place in places], axis=1)
    partly = np.flatnonzero(cells.any(axis=1) & ~cells.all(axis=1))
    if partly.size:
        names = ", ".join(place.column for place in places)
        where = f"{table.path}: columns {names}, {table.rows_in_words(partly)}"
        problems.append(Problem(where, "some of them are empty", "all of them, or none"))


def _uncertainty(table, target, turn, layout, problems) -> Columns:
    """Standard deviations and correlations (n,) of a target, NaN where the file has none."""
    values = np.full((9, len(table)), np.nan)
    if target.std:
        values[:3] = _spread(table, target.std, problems, layout.sigma).T
    if target.covariance:
        xx, xy, xz, yy, yz, zz = _stacked(table, target.covariance, problems, gaps=True).T
        problems += faults.covariance_problems(table, (xx, xy, xz, yy, yz, zz), target.covariance)
        with np.errstate(invalid="ignore", divide="ignore"):
            values[:3] = np.sqrt([xx, yy, zz])
            values[3:6] = xy / np.sqrt(xx * yy), xz / np.sqrt(xx * zz), yz / np.sqrt(yy * zz)
    if target.std_turn and target.turn and layout.orientation != "quaternion":
        std = _spread(table, target.std_turn, problems, layout.sigma)
        there = np.isfinite(turn).all(axis=1) & np.isfinite(std).all(axis=1)
        values[6:, there] = rotation_std(
            turn[there], _in_reading_order(std[there], layout), layout
        ).T
    return dict(zip(UNCERTAINTY, values, strict=True))


def _spread(table: RawTable, places: tuple[Place, ...], problems, sigma: int) -> np.ndarray:
    """Standard deviations (n, 3) of uncertainties that are ``sigma`` of them.

    An empty cell or a zero, which says nothing, is NaN.
    """
    std = _stacked(table, places, problems, gaps=True) / sigma
    problems += faults.negative(table, std, places)
    return np.where(std > 0.0, std, np.nan)


def _in_reading_order(std: np.ndarray, layout: Layout) -> np.ndarray:
    """``std_rx``, ``std_ry``, ``std_rz`` (n, 3) in the order of the convention's angles."""
    axes = layout.convention.lower()
    if layout.orientation != "euler" or len(set(axes)) < 3:
        return std
    return std[:, ["xyz".index(axis) for axis in axes]]


def _directions(table: RawTable, found: FoundColumns, joints: int, problems) -> np.ndarray:
    """Travel directions (n, k), 0 where the file says nothing."""
    s = np.zeros((len(table), joints), dtype=np.int8)
    for joint, place in found.directions.items():
        values = numbers(table, place.column, problems, gaps=True)
        bad = np.flatnonzero(np.isfinite(values) & ~np.isin(values, (-1, 0, 1)))
        if bad.size:
            where = f"{table.path}: column {place.column}, {table.rows_in_words(bad)}"
            problems.append(Problem(where, f"{values[bad[0]]:g}", "-1, 0 or 1"))
        s[:, joint] = np.where(np.isin(values, (-1, 0, 1)), values, 0)
    return s


def _payload(table: RawTable, places: tuple[Place, ...], problems) -> Columns:
    """Mass and centre (n,) of what is carried, NaN in rows that do not say; none without places.

    The centre is that of the last DH frame where the file states a mass alone.
    """
    if not places:
        return {}
    _refuse_parts(table, places, problems)
    values = _stacked(table, places, problems, gaps=True)
    bad = np.flatnonzero(values[:, 0] < 0.0)
    if bad.size:
        where = f"{table.path}: column {places[0].column}, {table.rows_in_words(bad)}"
        problems.append(Problem(where, f"a mass of {values[bad[0], 0]:g} kg", "0 or above"))
    if len(places) == 1:
        values = np.hstack([values, np.where(np.isnan(values), np.nan, 0.0).repeat(3, axis=1)])
    return dict(zip(PAYLOAD_COLUMNS, values.T, strict=True))


def _numbered(table: RawTable, found: FoundColumns, problems, again: bool = False) -> Columns:
    """Pose, repeat, session and temperature (n,); without poses every row is one of its own."""
    count = len(table)
    shared = {
        "pose": np.arange(count),
        "repeat": np.zeros(count, dtype=np.int64),
        "session": np.full(count, None, dtype=object),
        "temperature": np.full(count, np.nan),
    }
    for name, place in found.single.items():
        if name in ("target", "session"):
            shared[name] = _labels(table, place.column, problems)
        elif name == "temperature":
            shared[name] = numbers(table, place.column, problems, gaps=True)
        else:
            column = _poses(table, place.column) if again and name == "pose" else table
            shared[name] = _whole(column, place.column, problems, words=name == "pose")
    if "session" in found.single and "pose" in found.single:
        # Every session may count its poses from 0.
        pairs = list(zip(shared["session"], shared["pose"].tolist(), strict=True))
        shared["pose"] = _by_appearance(pairs)
    return shared


_AGAIN = re.compile(r"(?<=\d)[_-]\d+$")


def _poses(table: RawTable, column: str) -> RawTable:
    """The table with the names of poses without the number of the reading: P12 of P12_1."""
    cells = [_AGAIN.sub("", str(cell).strip()) for cell in table.columns[column]]
    return replace(table, columns=table.columns | {column: cells})


def _labels(table: RawTable, column: str, problems) -> np.ndarray:
    cells = [None if table.is_gap(cell) else str(cell).strip() for cell in table.columns[column]]
    labels = texts(cells)
    empty = np.flatnonzero([cell is None for cell in cells])
    if empty.size:
        where = f"{table.path}: column {column}, {table.rows_in_words(empty)}"
        problems.append(Problem(where, "is empty", "a name in every row"))
    return labels


def _whole(table: RawTable, column: str, problems, words: bool) -> np.ndarray:
    """Whole numbers (n,); with ``words``, names are numbered as they first appear."""
    found: list[Problem] = []
    values = numbers(table, column, found)
    if words and not np.isfinite(values).any():
        labels = _labels(table, column, problems)
        return _by_appearance(labels.tolist())
    wrong = (values < 0) | (values > _LARGEST_WHOLE) | (values % 1 != 0)
    bad = np.flatnonzero(np.isfinite(values) & wrong)
    if bad.size:
        where = f"{table.path}: column {column}, {table.rows_in_words(bad)}"
        found.append(Problem(where, f"{values[bad[0]]:g}", "whole numbers from 0"))
        values[bad] = 0
    problems += found
    return np.where(np.isfinite(values), values, 0).astype(np.int64)


def _by_appearance(labels: list) -> np.ndarray:
    numbers_of = {label: number for number, label in enumerate(dict.fromkeys(labels))}
    return np.array([numbers_of[label] for label in labels], dtype=np.int64)


def _keys(columns: Mapping) -> np.ndarray:
    """Number (n,) of every pose and target."""
    pairs = zip(columns["pose"].tolist(), columns["target"].tolist(), strict=True)
    return _by_appearance(list(pairs))


def _count_within(columns: Mapping) -> np.ndarray:
    """Running number of every row among the rows of its pose and target, from 0."""
    key = _keys(columns)
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    count = np.empty(len(key), dtype=np.int64)
    count[order] = np.arange(len(key)) - np.searchsorted(ordered, ordered, side="left")
    return count


def _doubled(table: RawTable, columns: Mapping, order: np.ndarray) -> list[Problem]:
    pairs = np.stack([_keys(columns), columns["repeat"]], axis=1)
    _, first, inverse = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[inverse.ravel()] != np.arange(len(pairs)))
    if not again.size:
        return []
    pose, repeat, target = (columns[name][again[0]] for name in ("pose", "repeat", "target"))
    of = "" if target == TOOL else f", target {target}"
    return [
        Problem(
            f"{table.path}: {table.rows_in_words(np.unique(order[again]))}",
            f"pose {pose}, repeat {repeat}{of} is given again",
            "one row per pose, repeat and target",
        )
    ]
