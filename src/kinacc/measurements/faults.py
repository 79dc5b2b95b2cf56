"""Faults in the values of a measured file, with their lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kinacc.errors import Problem
from kinacc.kinematics.robot import Robot, forward, outside_limits
from kinacc.measurements.layout import Place
from kinacc.measurements.table import RawTable
from kinacc.tables.columns import Columns

BEYOND = 1e8  # no unit makes a length of this
LIMIT_SLACK = 1e-6  # a joint may be beyond its limits by the last written digit
_UNIT_QUATERNION = 1e-3  # how far from 1 a measured quaternion's length may be


def none_read(points: np.ndarray, number: float) -> np.ndarray:
    """True (n,) where ``number`` means that a point (n, 3) was not read.

    It does so in all three coordinates; one that cannot be a coordinate, in any of them.
    """
    same = points == number
    return same.any(axis=1) if is_no_coordinate(number) else same.all(axis=1)


def is_no_coordinate(number: float) -> bool:
    """Whether a number is all nines, as in 9999, 9999.999 and 9E9, or beyond all lengths."""
    digits = f"{abs(number):.6f}".rstrip("0").rstrip(".").replace(".", "")
    return ({*digits} == {"9"} and len(digits) >= 4) or abs(number) >= BEYOND


def of_rows(
    table: RawTable, places: Sequence[Place], bad: np.ndarray, message: str, allowed: str
) -> list[Problem]:
    """A problem with columns in the rows where ``bad`` (n,) is True; none where it nowhere is."""
    names = ", ".join(place.column for place in places)
    return [Problem(table.where(names, bad), message, allowed)] if bad.any() else []


def quaternion_problems(
    table: RawTable, quaternion: np.ndarray, places: Sequence[Place]
) -> list[Problem]:
    """Quaternions (n, 4) whose length is not 1."""
    length = np.linalg.norm(quaternion, axis=1)
    bad = np.abs(length - 1.0) > _UNIT_QUATERNION
    message = f"quaternion of length {next(iter(length[bad]), 1.0):.6g}"
    return of_rows(table, places, bad, message, f"length 1 within {_UNIT_QUATERNION:g}")


def limit_problems(
    table: RawTable, q_rad: np.ndarray, robot: Robot, places: Sequence[Place]
) -> Iterator[Problem]:
    """Joint positions (n, k) beyond the robot's limits."""
    for fault in outside_limits(robot, q_rad, LIMIT_SLACK):
        place, rows = places[fault.joint - 1], np.asarray(fault.rows)
        message = f"{q_rad[rows[0], fault.joint - 1] / place.factor:g} is outside the joint limits"
        if place.factor == 1.0 and fault.looks_like_degrees:
            message += ": the column looks like degrees"
        yield Problem(table.where(place.column, rows), message, fault.allowed)


def scale_problems(table: RawTable, columns: Columns, robot: Robot) -> Iterator[Problem]:
    """Units that cannot be meant: measured points spread unlike the points the arm reaches."""
    joints = robot.dh.joints
    q_rad = np.stack([columns[f"q{i + 1}"] for i in range(joints)], axis=1)
    points = np.stack([columns[f"{axis}_mm"] for axis in "xyz"], axis=1)
    expected, measured = (
        float(np.sqrt(points.var(axis=0).sum()))
        for points in (forward(robot, q_rad).position_mm, points)
    )
    if len(q_rad) < 4 or expected < 1.0:
        return
    ratio, turning = measured / expected, np.abs(q_rad[:, ~robot.dh.prismatic])
    hint = ""
    if ratio < 0.02:
        hint = "the positions look like metres"
    elif ratio > 50.0:
        hint = "the positions look like micrometres, or the joints like radians"
    elif ratio > 3.0 and turning.max() < np.deg2rad(2.0 * np.pi) + 1e-9:
        hint = "the joints look like radians"
    if hint:
        message = f"the points spread over {measured:.4g} mm rms, the arm over {expected:.4g} mm"
        where = f"{table.path}: columns x, y, z and q1 .. q{joints}"
        yield Problem(where, message, "about the same", hint)
