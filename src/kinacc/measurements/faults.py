"""Faults in the values of a measured file, with their lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kinacc.errors import Problem
from kinacc.kinematics.robot import Robot, outside_limits
from kinacc.measurements.layout import Place
from kinacc.measurements.table import RawTable

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
    table: RawTable,
    places: Sequence[Place],
    bad: np.ndarray,
    message: str,
    allowed: str,
    values: np.ndarray | None = None,
) -> list[Problem]:
    """A problem with columns in the rows where ``bad`` (n,) is True; none where it nowhere is.

    ``message`` is a format for the first of the bad ``values`` (n,).
    """
    if not bad.any():
        return []
    names = ", ".join(place.column for place in places)
    first = [] if values is None else values[bad][:1]
    return [Problem(table.where(names, bad), message.format(*first), allowed)]


def quaternion_problems(
    table: RawTable, quaternion: np.ndarray, places: Sequence[Place]
) -> list[Problem]:
    """Quaternions (n, 4) whose length is not 1."""
    length = np.linalg.norm(quaternion, axis=1)
    bad = np.abs(length - 1.0) > _UNIT_QUATERNION
    allowed = f"length 1 within {_UNIT_QUATERNION:g}"
    return of_rows(table, places, bad, "quaternion of length {:.6g}", allowed, length)


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
