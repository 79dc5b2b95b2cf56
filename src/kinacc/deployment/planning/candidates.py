"""Poses that could be measured: spread evenly over joints, kept where the tool may be."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose, compose
from kinacc.kinematics import dh
from kinacc.kinematics.region import points
from kinacc.kinematics.robot import Robot

_MOST_DRAWS_PER_POSE = 400


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
            joints = joints[inside(_tool_positions(robot, joints, tool))]
        found.append(joints)
        first += block
    return np.concatenate(found)[:count]


def _tool_positions(robot: Robot, joints: np.ndarray, tool: Pose | None) -> np.ndarray:
    end = compose(robot.base, dh.forward(robot.dh, robot.dh_joints(joints)))
    return end.position_mm if tool is None else compose(end, tool).position_mm
