"""What of a measurement file cannot be meant: values with their lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from kinacc.errors import Problem
from kinacc.kinematics.robot import Robot, forward, outside_limits
from kinacc.measurements.layout import Place
from kinacc.measurements.table import RawTable

BEYOND = 1e8  # no unit makes a length of this
LIMIT_SLACK = 1e-6  # a joint may be beyond its limits by the last written digit
_UNIT_QUATERNION = 1e-3  # how far from 1 a measured quaternion's length may be


def none_read(points: np.ndarray, number: float) -> np.ndarray:
    """True (n,) where ``number`` says of a point (n, 3) that it was not read.

    It does so in all three coordinates; one that cannot be a coordinate, in any of them.
    """
    same = points == number
    return same.any(axis=1) if is_no_coordinate(number) else same.all(axis=1)


def is_no_coordinate(number: float) -> bool:
    """Whether a number is all nines, as in 9999, 9999.999 and 9E9, or beyond all lengths."""
    digits = f"{abs(number):.6f}".rstrip("0").rstrip(".").replace(".", "")
    return ({*digits} == {"9"} and len(digits) >= 4) or abs(number) >= BEYOND


def at(
    table: RawTable, places: Sequence[Place], bad: np.ndarray, what: str, allowed: str
) -> Problem:
    """What is wrong with columns in the rows ``bad``, indices or marks (n,)."""
    bad = np.flatnonzero(bad) if bad.dtype == bool else bad
    names = ", ".join(table.column_in_words(place.column) for place in places)
    word = "columns" if len(places) > 1 else "column"
    return Problem(f"{table.path}: {word} {names}, {table.rows_in_words(bad)}", what, allowed)


def quaternion_problems(
    table: RawTable, quaternion: np.ndarray, places: Sequence[Place]
) -> Iterator[Problem]:
    """Quaternions (n, 4) whose length is not 1."""
    length = np.linalg.norm(quaternion, axis=1)
    bad = np.flatnonzero(np.abs(length - 1.0) > _UNIT_QUATERNION)
    if bad.size:
        what = f"quaternion of length {length[bad[0]]:.6g}"
        yield at(table, places, bad, what, f"length 1 within {_UNIT_QUATERNION:g}")


def covariance_problems(
    table: RawTable, covariance: np.ndarray, places: Sequence[Place]
) -> Iterator[Problem]:
    """Matrices (n, 3, 3) that are no covariances."""
    there = np.isfinite(covariance).all(axis=(1, 2))
    eigenvalues = np.linalg.eigvalsh(covariance[there])
    wrong = np.flatnonzero(there)[eigenvalues[:, 0] < -1e-9 * np.abs(eigenvalues[:, 2])]
    wrong = np.union1d(wrong, np.flatnonzero((np.einsum("nii->ni", covariance) <= 0.0).any(axis=1)))
    if wrong.size:
        allowed = "a matrix without negative variances"
        yield at(table, places, wrong, "is no covariance", allowed)


def limit_problems(
    table: RawTable, q_rad: np.ndarray, robot: Robot, places: Sequence[Place]
) -> Iterator[Problem]:
    """Joint positions (n, k) beyond the robot's limits."""
    for each in outside_limits(robot, q_rad, LIMIT_SLACK):
        place = places[each.joint - 1]
        in_file = q_rad[each.rows[0], each.joint - 1] / place.factor
        what = f"{in_file:g} is outside the joint limits"
        if place.factor == 1.0 and each.looks_like_degrees:
            what += ": the column looks like degrees"
        yield at(table, [place], np.asarray(each.rows), what, each.allowed)


def scale_problems(table: RawTable, columns: Mapping, robot: Robot) -> Iterator[Problem]:
    """Units that cannot be meant: measured points spread unlike the points the arm reaches."""
    joints = robot.dh.joints
    q_rad = np.stack([columns[f"q{i + 1}"] for i in range(joints)], axis=1)
    expected = _spread(forward(robot, q_rad).position_mm)
    measured = _spread(np.stack([columns[f"{axis}_mm"] for axis in "xyz"], axis=1))
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
        told = f"the points spread over {measured:.4g} mm rms, the joints move {robot.name} by "
        told += f"{expected:.4g} mm rms"
        where = f"{table.path}: columns x, y, z and q1 .. q{joints}"
        yield Problem(where, told, "about the same", hint)


def _spread(points_mm: np.ndarray) -> float:
    centred = points_mm - points_mm.mean(axis=0)
    return float(np.sqrt(np.mean(np.sum(centred**2, axis=1))))
