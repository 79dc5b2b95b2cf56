"""Measured poses of a file, checked and converted once to millimetres and radians."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.data.table import RawTable, load, numbers
from kinacc.errors import InputError, Problem
from kinacc.geometry import quaternion_from_rotation
from kinacc.models import dh as _dh
from kinacc.robot import Robot, dh_angles

TOOL = "tool"

_TO_RAD = {"deg": np.pi / 180.0, "rad": 1.0}
_TO_MM = {"mm": 1.0, "m": 1000.0}
_UNIT_QUATERNION = 1e-3  # how far from 1 a measured quaternion's length may be
_ORIENTATION_NAMES = {
    "none": (),
    "quaternion": ("qw", "qx", "qy", "qz"),
    "rotation_vector": ("rx", "ry", "rz"),
    "euler": ("rx", "ry", "rz"),
}


@dataclass(frozen=True)
class Layout:
    """How a file states its measurements; the ``measurements.file`` section of the configuration.

    ``columns`` maps our names (``q1``, ``x``, ``rx``, ``pose``, ...) to the file's own, which then
    carry ``joint_unit``, ``length_unit`` and ``angle_unit``; other columns carry the unit in their
    name (``q1_deg``, ``x_m``).
    """

    columns: Mapping[str, str]
    joint_unit: str = "deg"
    length_unit: str = "mm"
    orientation: str = "euler"
    convention: str = "XYZ"
    angle_unit: str = "deg"

    @classmethod
    def of(cls, section: Mapping) -> Layout:
        """Layout from the configuration section ``measurements.file``."""
        turn = section["orientation"]
        return cls(
            section["columns"],
            section["joint_unit"],
            section["length_unit"],
            turn["kind"],
            turn["convention"],
            turn["unit"],
        )


@dataclass(frozen=True)
class Reading:
    """``columns`` of the measurements artefact without folds, and the names that were not used."""

    columns: dict[str, np.ndarray]
    unused: tuple[str, ...]


@dataclass(frozen=True)
class _Column:
    """Where a quantity stands in the file and the factor to our unit."""

    name: str
    factor: float


def read(section: Mapping, robot: Robot) -> Reading:
    """Measurements of the file that ``section`` (``measurements.file``) names.

    Raises InputError listing everything that is wrong with the file.
    """
    table = load(section["path"], section["delimiter"], section["decimal"], section.get("source"))
    return convert(table, Layout.of(section), robot)


def convert(table: RawTable, layout: Layout, robot: Robot) -> Reading:
    """Measurements of a table as read. Raises InputError listing every problem."""
    problems: list[Problem] = []
    joints = robot.dh.joints
    found = _find(table, layout, joints, problems)
    if problems:
        raise InputError(problems, f"{table.path} cannot be used")
    scaled = {
        name: numbers(table, place.name, problems) * place.factor for name, place in found.items()
    }
    names = _ORIENTATION_NAMES[layout.orientation]
    turns = np.stack([scaled[name] for name in names], axis=1) if names else None
    if turns is not None and layout.orientation == "quaternion":
        problems += _quaternion_problems(table, turns)
    q_rad = np.stack([scaled[f"q{i}"] for i in range(1, joints + 1)], axis=1)
    position_mm = np.stack([scaled[axis] for axis in "xyz"], axis=1)
    problems += _limit_problems(table, q_rad, robot, found)
    s = _directions(table, layout, joints, problems)
    pose, repeat = _numbering(table, layout, problems)
    if not problems:
        problems += _scale_problems(table, q_rad, position_mm, robot)
    if problems:
        raise InputError(problems, f"{table.path} cannot be used")
    columns = {"pose": pose}
    columns |= {f"q{i + 1}": q_rad[:, i] for i in range(joints)}
    columns |= {f"s{i + 1}": s[:, i] for i in range(joints)}
    columns["target"] = np.full(len(table), TOOL, dtype=object)
    columns |= dict(zip(("x_mm", "y_mm", "z_mm"), position_mm.T, strict=True))
    quaternion = _quaternions(turns, layout, len(table))
    columns |= dict(zip(("qw", "qx", "qy", "qz"), quaternion.T, strict=True))
    columns["repeat"] = repeat
    used = {place.name for place in found.values()} | set(_extras(table, layout, joints).values())
    return Reading(columns, tuple(name for name in table.columns if name not in used))


def _find(
    table: RawTable, layout: Layout, joints: int, problems: list[Problem]
) -> dict[str, _Column]:
    """Columns of every quantity wanted; what is missing is added to ``problems``."""
    wanted = [(f"q{i}", layout.joint_unit, _TO_RAD) for i in range(1, joints + 1)]
    wanted += [(axis, layout.length_unit, _TO_MM) for axis in "xyz"]
    for name in _ORIENTATION_NAMES[layout.orientation]:
        units = {"": 1.0} if layout.orientation == "quaternion" else _TO_RAD
        wanted.append(
            (name, "" if layout.orientation == "quaternion" else layout.angle_unit, units)
        )
    found = {}
    for name, unit, units in wanted:
        place = _place(table, layout, name, unit, units, problems)
        if place is not None:
            found[name] = place
    spare = f"q{joints + 1}"
    if any(column in table.columns for column in (f"{spare}_deg", f"{spare}_rad")):
        where = f"{table.path}: columns"
        problems.append(Problem(where, f"{spare} is there, the robot has {joints} joints"))
    return found


def _place(
    table: RawTable,
    layout: Layout,
    name: str,
    unit: str,
    units: Mapping[str, float],
    problems: list[Problem],
) -> _Column | None:
    if name in layout.columns:
        foreign = layout.columns[name]
        if foreign in table.columns:
            return _Column(foreign, units[unit])
        problems.append(
            Problem(
                f"{table.path}: column {foreign}",
                f"is not there, but measurements.file.columns maps {name} to it",
                _listed(table),
            )
        )
        return None
    own = [f"{name}_{each}" if each else name for each in units]
    present = [
        (each, factor)
        for each, factor in zip(own, units.values(), strict=True)
        if each in table.columns
    ]
    if len(present) == 1:
        return _Column(*present[0])
    what = "is given in two units" if present else "is missing"
    problems.append(
        Problem(
            f"{table.path}: column {' or '.join(own)}",
            what,
            _listed(table),
            "" if present else f"or map {name} in measurements.file.columns",
        )
    )
    return None


def _listed(table: RawTable) -> str:
    return "the file has " + ", ".join(table.columns)


def _extras(table: RawTable, layout: Layout, joints: int) -> dict[str, str]:
    """Optional columns that are there: our name -> the file's name."""
    names = ["pose", "repeat", *(f"s{i}" for i in range(1, joints + 1))]
    own = {name: layout.columns.get(name, name) for name in names}
    return {name: column for name, column in own.items() if column in table.columns}


def _directions(
    table: RawTable, layout: Layout, joints: int, problems: list[Problem]
) -> np.ndarray:
    """Travel directions (n, k), 0 where the file says nothing."""
    s = np.zeros((len(table), joints), dtype=np.int8)
    for name, column in _extras(table, layout, joints).items():
        if not name.startswith("s"):
            continue
        values = numbers(table, column, problems)
        bad = np.flatnonzero(np.isfinite(values) & ~np.isin(values, (-1, 0, 1)))
        if bad.size:
            where = f"{table.path}: column {column}, {table.rows_in_words(bad)}"
            problems.append(Problem(where, f"{values[bad[0]]:g}", "-1, 0 or 1"))
        s[:, int(name[1:]) - 1] = np.where(np.isin(values, (-1, 0, 1)), values, 0)
    return s


def _numbering(
    table: RawTable, layout: Layout, problems: list[Problem]
) -> tuple[np.ndarray, np.ndarray]:
    """Pose and repeat numbers (n,); without them every row is a pose of its own."""
    extras = _extras(table, layout, 0)
    found = {}
    for name in ("pose", "repeat"):
        if name in extras:
            values = numbers(table, extras[name], problems)
            bad = np.flatnonzero(np.isfinite(values) & ((values < 0) | (values % 1 != 0)))
            if bad.size:
                where = f"{table.path}: column {extras[name]}, {table.rows_in_words(bad)}"
                problems.append(Problem(where, f"{values[bad[0]]:g}", "whole numbers from 0"))
            found[name] = np.where(np.isfinite(values), values, 0).astype(np.int64)
    pose = found.get("pose", np.arange(len(table)))
    repeat = found.get("repeat")
    if repeat is None:
        repeat = _count_within(pose)
    elif "pose" in found:
        problems += _doubled(table, pose, repeat)
    return pose, repeat


def _count_within(pose: np.ndarray) -> np.ndarray:
    """Running number of every row among the rows of its pose, from 0."""
    order = np.argsort(pose, kind="stable")
    ordered = pose[order]
    first = np.searchsorted(ordered, ordered, side="left")
    count = np.empty(len(pose), dtype=np.int64)
    count[order] = np.arange(len(pose)) - first
    return count


def _doubled(table: RawTable, pose: np.ndarray, repeat: np.ndarray) -> list[Problem]:
    pairs = np.stack([pose, repeat], axis=1)
    _, first, inverse = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[inverse.ravel()] != np.arange(len(pose)))
    if not again.size:
        return []
    row = again[0]
    return [
        Problem(
            f"{table.path}: {table.rows_in_words(again)}",
            f"pose {pose[row]}, repeat {repeat[row]} is given again",
            "one row per pose and repeat",
        )
    ]


def _quaternion_problems(table: RawTable, quaternion: np.ndarray) -> list[Problem]:
    length = np.linalg.norm(quaternion, axis=1)
    bad = np.flatnonzero(np.isfinite(length) & (np.abs(length - 1.0) > _UNIT_QUATERNION))
    if not bad.size:
        return []
    return [
        Problem(
            f"{table.path}: columns qw, qx, qy, qz, {table.rows_in_words(bad)}",
            f"quaternion of length {length[bad[0]]:.6g}",
            f"length 1 within {_UNIT_QUATERNION:g}",
            "check the order w, x, y, z and the decimals written",
        )
    ]


def _limit_problems(
    table: RawTable, q_rad: np.ndarray, robot: Robot, found: Mapping[str, _Column]
) -> list[Problem]:
    problems = []
    slack = 1e-6
    for joint in range(robot.dh.joints):
        low, high = robot.q_min_rad[joint], robot.q_max_rad[joint]
        values = q_rad[:, joint]
        bad = np.flatnonzero((values < low - slack) | (values > high + slack))
        if bad.size:
            column = found[f"q{joint + 1}"]
            limits = f"{np.rad2deg(low):g} to {np.rad2deg(high):g} deg ({robot.name})"
            hint = ""
            if column.factor == 1.0 and np.max(np.abs(values)) > 4.0 * np.pi:
                hint = "the column looks like degrees"
            value = f"{values[bad[0]] / column.factor:g}"
            where = f"{table.path}: column {column.name}, {table.rows_in_words(bad)}"
            problems.append(Problem(where, f"{value} is outside the joint limits", limits, hint))
    return problems


def _scale_problems(
    table: RawTable, q_rad: np.ndarray, position_mm: np.ndarray, robot: Robot
) -> list[Problem]:
    """Units that cannot be meant: measured points spread unlike the points the arm reaches."""
    expected = _spread(_dh.forward(robot.dh, dh_angles(robot, q_rad)).position_mm)
    measured = _spread(position_mm)
    if len(table) < 4 or expected < 1.0:
        return []
    ratio = measured / expected
    where = f"{table.path}: columns x, y, z and q1 .. q{robot.dh.joints}"
    told = (
        f"the points spread over {measured:.4g} mm rms, the joints move {robot.name} by "
        f"{expected:.4g} mm rms"
    )
    if ratio < 0.02:
        return [Problem(where, told, "about the same", "the positions look like metres")]
    if ratio > 50.0:
        hint = "the positions look like micrometres, or the joints like radians"
        return [Problem(where, told, "about the same", hint)]
    if ratio > 3.0 and np.max(np.abs(q_rad)) < np.deg2rad(2.0 * np.pi) + 1e-9:
        return [Problem(where, told, "about the same", "the joints look like radians")]
    return []


def _spread(points_mm: np.ndarray) -> float:
    centred = points_mm - points_mm.mean(axis=0)
    return float(np.sqrt(np.mean(np.sum(centred**2, axis=1))))


def _quaternions(turns: np.ndarray | None, layout: Layout, count: int) -> np.ndarray:
    """Unit quaternions (n, 4) w, x, y, z with w >= 0; NaN for position only."""
    if turns is None:
        return np.full((count, 4), np.nan)
    if layout.orientation == "quaternion":
        unit = turns / np.linalg.norm(turns, axis=1, keepdims=True)
        return np.where(unit[:, :1] < 0.0, -unit, unit)
    from scipy.spatial.transform import Rotation

    if layout.orientation == "rotation_vector":
        rotation = Rotation.from_rotvec(turns)
    else:
        rotation = Rotation.from_euler(layout.convention, turns)
    return quaternion_from_rotation(rotation.as_matrix())
