"""Joints that reach a position in the posture that a program states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import dh
from kinacc.kinematics.inverse import limits, solve
from kinacc.kinematics.robot import Robot

Posture = Callable[[Sequence[bool], np.ndarray], tuple[str, ...]]
Stated = tuple[str | None, ...]
_ROUNDING_DEG = 0.02  # a program's rounded numbers move a joint across a boundary by no more


def unmatched(
    robot: Robot, posture: Posture, stated: Stated, q_rad: np.ndarray, slack_deg: float = 1e-6
) -> str:
    """Parts of the posture at joints (k,) that are not as stated, joints moved by the slack.

    Sides are those of an arm of six turning joints: whether the wrist is in front of axis 1, axis 3
    above the line from axis 2 to the wrist (as of an upright arm that reaches forward), and joint 5
    positive. Front is the base's x axis at zero of joint 1.
    """
    poses = np.stack([q_rad, 0.0 * q_rad])
    frames = compose(robot.base, dh.chain(robot.dh, robot.dh_joints(poses)))
    place = frames.position_mm[0]
    turned = frames.rotation[0, 1] @ frames.rotation[1, 1].T  # by joint 1 alone
    arm = np.cross(place[2] - place[1], place[4] - place[2])
    ahead, above = turned[:, 0] @ (place[4] - place[0]) >= 0.0, arm @ turned[:, 1] > 0.0
    slacks = np.array([0.0, slack_deg, -slack_deg])
    names = [posture((ahead, above, q[4] > 0.0), q) for q in np.rad2deg(q_rad) + slacks[:, None]]
    parts = zip(stated, *names, strict=False)  # some programs state the first parts alone
    return ", ".join(now for wanted, now, *near in parts if wanted not in (None, now, *near))


def postures_of(robot: Robot, flange: Sequence[Pose]) -> list[np.ndarray]:
    """Reported joints (m, k) of all postures at flange poses; NaN where not reached."""
    if not flange:
        return []
    stacked = Pose(*(np.stack(part) for part in zip(*flange, strict=True)))
    goal = compose(invert(robot.base), compose(stacked, invert(robot.flange)))
    return [*limits.reported_joints(robot, solve(robot, robot.dh, goal).q_rad)]


def choose(
    robot: Robot,
    ways: np.ndarray,
    posture: Posture,
    stated: Stated,
    near_rad: np.ndarray | None,
) -> np.ndarray | str:
    """Of postures (m, k) on all turns within the limits the one stated, nearest to ``near_rad``.

    A reason where there are none, or several and nothing to choose by.
    """
    turns = [(0.0,) if slides else 2.0 * np.pi * np.arange(-2, 3) for slides in robot.dh.prismatic]
    ways = (ways[:, None] + np.array([*product(*turns)])).reshape(-1, robot.dh.joints)
    ways = ways[~limits.outside(ways, (robot.q_min_rad, robot.q_max_rad)).any(axis=1)]
    texts = "within its limits"
    if stated:
        fits = [not unmatched(robot, posture, stated, way, _ROUNDING_DEG) for way in ways]
        ways, texts = ways[fits], f"in the posture {', '.join(filter(None, stated))}"
    elif near_rad is None and len(ways) > 1:
        return "no posture is stated; give joints to start from: --near-deg"
    if not len(ways):
        return f"the nominal arm cannot reach it {texts}"
    distance = np.abs(ways - (0.0 if near_rad is None else near_rad)).max(axis=1)
    return ways[np.argmin(distance.round(9))]
