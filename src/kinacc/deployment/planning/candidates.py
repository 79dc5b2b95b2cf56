"""Poses that could be measured: spread evenly over joints, or drawn between measured poses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose, compose
from kinacc.kinematics import dh
from kinacc.kinematics.region import points
from kinacc.kinematics.robot import Robot

_MOST_DRAWS_PER_POSE = 400
_NEIGHBOURS = 10  # of a measured pose, between which and the pose others are drawn


def spread(
    robot: Robot,
    count: int,
    box_rad: tuple[np.ndarray, np.ndarray] | None = None,
    inside: Callable[[np.ndarray], np.ndarray] | None = None,
    tool: Pose | None = None,
) -> np.ndarray:
    """``count`` reported joints (count, k) from a Sobol sequence over ``box_rad`` (the limits).

    ``inside`` takes tool positions (m, 3) mm in the robot's base and says which are allowed.
    Raises InputError where too few are, or the box lies outside the limits.
    """
    low, high = (robot.q_min_rad, robot.q_max_rad) if box_rad is None else box_rad
    low, high = np.maximum(low, robot.q_min_rad), np.minimum(high, robot.q_max_rad)
    problems = [
        Problem(f"joint {joint + 1}", "its range lies outside the limits")
        for joint in np.flatnonzero(low >= high)
    ]
    refuse(problems, "There are no poses to choose from")
    found: list[np.ndarray] = []
    first, block = 1, max(count, 1024)
    while sum(map(len, found)) < count:
        if first > _MOST_DRAWS_PER_POSE * block:
            what = f"only {sum(map(len, found))} of {first - 1} joint values put the tool there"
            raise InputError(Problem("region", what, f"{count} candidates", "enlarge the region"))
        joints = low + points("sobol", block, len(low), first) * (high - low)
        if inside is not None:
            joints = joints[inside(tool_positions(robot, joints, tool))]
        found.append(joints)
        first += block
    return np.concatenate(found)[:count]


def between(measured: np.ndarray, unit: np.ndarray, count: int, seed: int) -> np.ndarray:
    """``count`` joints (count, k) on the way from one of ``measured`` (n, k) to a neighbour.

    ``unit`` (k,): movements of the joints that count alike. Raises InputError where all of
    ``measured`` are the same.
    """
    from scipy.spatial import cKDTree

    different = np.unique(measured, axis=0)
    if len(different) < 2:
        what = "all measured poses are at the same joints"
        raise InputError(Problem("region", what, "at least 2 different poses"))
    random = np.random.default_rng(seed)
    near = cKDTree(different / unit).query(different / unit, min(_NEIGHBOURS + 1, len(different)))
    start = random.integers(len(different), size=count)
    end = near[1][start, random.integers(1, near[1].shape[1], size=count)]
    share = random.random((count, 1))
    return different[start] + share * (different[end] - different[start])


def tool_positions(robot: Robot, joints: np.ndarray, tool: Pose | None) -> np.ndarray:
    """Where the nominal arm puts the tool (m, 3) in its base at reported joints (m, k)."""
    end = compose(robot.base, dh.forward(robot.dh, robot.dh_joints(joints)))
    return end.position_mm if tool is None else compose(end, tool).position_mm
