"""What of a measurement file cannot be meant: units of columns, and values with their lines."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from kinacc.errors import Problem
from kinacc.kinematics.robot import Robot, forward, outside_limits
from kinacc.measurements.column_names import KNOWN, name_of
from kinacc.measurements.layout import (
    ANGLE,
    ANGLES,
    ANGLES_IN_ORDER,
    LENGTH,
    POSITION,
    STD,
    STD_TURN,
    Layout,
    Place,
    split,
)
from kinacc.measurements.table import RawTable

BEYOND = 1e8  # no unit makes a length of this
_NINES = 4
_UNIT_QUATERNION = 1e-3  # how far from 1 a measured quaternion's length may be
LIMIT_SLACK = 1e-6  # a joint may be beyond its limits by the last written digit
_CORRELATION = 1.0 + 1e-6  # a correlation may exceed 1 by rounding only
_JOINT = re.compile(r"q(?P<number>\d)(?:_cmd)?")
_DEFAULT = {"joint_unit": "deg", "length_unit": "mm", "orientation.unit": "deg"}


def none_read(points: np.ndarray, number: float) -> np.ndarray:
    """True (n,) where ``number`` says of a point (n, 3) that it was not read.

    It does so in all three coordinates; one that cannot be a coordinate, in any of them.
    """
    same = points == number
    return same.any(axis=1) if is_no_coordinate(number) else same.all(axis=1)


def is_no_coordinate(number: float) -> bool:
    """Whether a number is all nines, as in 9999, 9999.999 and 9E9, or beyond all lengths."""
    digits = f"{abs(number):.6f}".rstrip("0").rstrip(".").replace(".", "")
    nines = set(digits) == {"9"} and len(digits) >= _NINES
    return nines or abs(number) >= BEYOND


def quaternion_problems(
    table: RawTable, quaternion: np.ndarray, places: Sequence[Place]
) -> list[Problem]:
    """Quaternions (n, 4) whose length is not 1."""
    length = np.linalg.norm(quaternion, axis=1)
    bad = np.flatnonzero(np.isfinite(length) & (np.abs(length - 1.0) > _UNIT_QUATERNION))
    if not bad.size:
        return []
    names = ", ".join(place.column for place in places)
    return [
        Problem(
            f"{table.path}: columns {names}, {table.rows_in_words(bad)}",
            f"quaternion of length {length[bad[0]]:.6g}",
            f"length 1 within {_UNIT_QUATERNION:g}",
            "check which columns hold it and the decimals written",
        )
    ]


def negative(table: RawTable, values: np.ndarray, places: Sequence[Place]) -> list[Problem]:
    """Standard deviations (n, len(places)) below zero."""
    found = []
    for place, column in zip(places, values.T, strict=True):
        bad = np.flatnonzero(column < 0.0)
        if bad.size:
            where = f"{table.path}: column {place.column}, {table.rows_in_words(bad)}"
            value = column[bad[0]] / place.factor
            found.append(Problem(where, f"standard deviation {value:g}", "0 or above"))
    return found


def covariance_problems(
    table: RawTable, elements: Sequence[np.ndarray], places: Sequence[Place]
) -> list[Problem]:
    """Covariances (xx, xy, xz, yy, yz, zz, each (n,)) that are none."""
    xx, xy, xz, yy, yz, zz = elements
    with np.errstate(invalid="ignore", divide="ignore"):
        correlations = np.abs([xy / np.sqrt(xx * yy), xz / np.sqrt(xx * zz), yz / np.sqrt(yy * zz)])
        determinant = xx * (yy * zz - yz**2) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
        wrong = (np.min([xx, yy, zz], axis=0) <= 0.0) | (correlations.max(axis=0) > _CORRELATION)
        wrong |= determinant < -1e-9 * xx * yy * zz
    bad = np.flatnonzero(wrong)
    if not bad.size:
        return []
    names = ", ".join(place.column for place in places)
    where = f"{table.path}: columns {names}, {table.rows_in_words(bad)}"
    return [Problem(where, "is no covariance", "a matrix without negative variances")]


def limit_problems(
    table: RawTable, q_rad: np.ndarray, robot: Robot, places: Sequence[Place]
) -> list[Problem]:
    """Joint positions (n, k) beyond the robot's limits."""
    problems = []
    for each in outside_limits(robot, q_rad, LIMIT_SLACK):
        place = places[each.joint - 1]
        in_file = q_rad[each.rows[0], each.joint - 1] / place.factor
        hint = "the column looks like degrees" if place.factor == 1.0 else ""
        where = f"{table.path}: column {place.column}, {table.rows_in_words(each.rows)}"
        what = f"{in_file:g} is outside the joint limits"
        problems.append(Problem(where, what, each.allowed, hint if each.looks_like_degrees else ""))
    return problems


def scale_problems(table: RawTable, columns: Mapping, robot: Robot) -> list[Problem]:
    """Units that cannot be meant: measured points spread unlike the points the arm reaches."""
    joints = robot.dh.joints
    q_rad = np.stack([columns[f"q{i + 1}"] for i in range(joints)], axis=1)
    position_mm = np.stack([columns[f"{axis}_mm"] for axis in "xyz"], axis=1)
    expected = _spread(forward(robot, q_rad).position_mm)
    measured = _spread(position_mm)
    if len(q_rad) < 4 or expected < 1.0:
        return []
    ratio = measured / expected
    where = f"{table.path}: columns x, y, z and q1 .. q{joints}"
    told = (
        f"the points spread over {measured:.4g} mm rms, the joints move {robot.name} by "
        f"{expected:.4g} mm rms"
    )
    if ratio < 0.02:
        return [Problem(where, told, "about the same", "the positions look like metres")]
    if ratio > 50.0:
        hint = "the positions look like micrometres, or the joints like radians"
        return [Problem(where, told, "about the same", hint)]
    turning = q_rad[:, ~robot.dh.prismatic]
    if ratio > 3.0 and np.max(np.abs(turning)) < np.deg2rad(2.0 * np.pi) + 1e-9:
        return [Problem(where, told, "about the same", "the joints look like radians")]
    return []


def _spread(points_mm: np.ndarray) -> float:
    centred = points_mm - points_mm.mean(axis=0)
    return float(np.sqrt(np.mean(np.sum(centred**2, axis=1))))


def unit_problems(table: RawTable, layout: Layout, prismatic: np.ndarray) -> Iterator[Problem]:
    """Keys that state another unit than the columns they are about.

    A key that is the default may not be meant: of our names (q1_rad) the name is believed then.
    ``prismatic`` (k,) marks joints whose position is a length.
    """
    keys = {
        **({} if layout.pulses_per_deg else {"joint_unit": layout.joint_unit}),
        "length_unit": layout.length_unit,
        "orientation.unit": layout.angle_unit,
    }
    for key, unit in keys.items():
        said = _of_mapped(table, layout, prismatic, key)
        # Where a mapped column states no unit, the key is about that one.
        if unit != _DEFAULT[key] and None not in said.values():
            said |= _of_our_names(table, layout, prismatic, key)
        for other in dict.fromkeys(said.values()):
            if other in (None, unit):
                continue
            columns = ", ".join(column for column, each in said.items() if each == other)
            yield Problem(
                f"{table.path}: column {columns}",
                f"says {other}, but measurements.file.{key} says {unit}",
                "the same in both places",
                "correct the key, or the name where it is the one that is wrong",
            )


def _of_mapped(table: RawTable, layout: Layout, prismatic, key: str) -> dict[str, str | None]:
    """Units that mapped columns state which ``key`` is about, None for none."""
    return {
        column: _stated_unit(table, column)
        for ours, column in layout.columns.items()
        if column in table.columns and _key(ours, prismatic) == key
    }


def _of_our_names(table: RawTable, layout: Layout, prismatic, key: str) -> dict[str, str | None]:
    """Units of the columns with our names for joints, positions and angles."""
    allowed = LENGTH if key == "length_unit" else ANGLE
    found: dict[str, str | None] = {}
    for column in table.columns:
        ours, _, unit = column.rpartition("_")
        value = split(ours)[1] in (*POSITION, *ANGLES, *ANGLES_IN_ORDER) or _JOINT.fullmatch(ours)
        if value and ours not in layout.columns and unit in allowed:
            found |= {column: unit} if _key(ours, prismatic) == key else {}
    return found


def _stated_unit(table: RawTable, column: str) -> str | None:
    """The unit a column states in its name or under it, None for none that is known."""
    place = list(table.columns).index(column)
    under = table.under[place] if place < len(table.under) else ""
    said = name_of(column, under if name_of("x", under).unit in KNOWN else "").unit
    return said if said in KNOWN or " or " in said else None


def _key(name: str, prismatic) -> str:
    """The key that states the unit of a quantity of our name, empty where none does."""
    if joint := _JOINT.fullmatch(name):
        number = int(joint["number"])
        return "length_unit" if number <= len(prismatic) and prismatic[number - 1] else "joint_unit"
    quantity = split(name)[1]
    if quantity in (*POSITION, *STD):
        return "length_unit"
    return "orientation.unit" if quantity in (*ANGLES, *ANGLES_IN_ORDER, *STD_TURN) else ""
