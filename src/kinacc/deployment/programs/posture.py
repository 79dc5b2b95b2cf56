"""Joints that reach a position in the posture that a program states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import dh
from kinacc.kinematics.inverse import limits, solve
from kinacc.kinematics.robot import Robot

Named = Callable[[Sequence[bool], np.ndarray], tuple[str, ...]]
_STATED_DEG = 0.02  # a program's rounded numbers move a joint across a boundary by no more


def sides(robot: Robot, q_rad: np.ndarray) -> np.ndarray:
    """Sides (n, 3) of an arm of six turning joints at reported joints (n, 6).

    Whether the wrist is in front of axis 1, axis 3 above the line from axis 2 to the wrist (as of
    an upright arm that reaches forward), and joint 5 positive. Front is the base's x axis at zero
    of joint 1.
    """
    q_rad = np.atleast_2d(q_rad)
    frames = dh.chain(robot.dh, robot.dh_joints(q_rad))
    frames = compose(robot.base, frames)
    zero = compose(robot.base, dh.chain(robot.dh, robot.dh_joints(0.0 * q_rad)))
    # The first frame turns with joint 1 alone.
    turn = frames.rotation[:, 1] @ np.swapaxes(zero.rotation[:, 1], 1, 2)
    front, left = turn[:, :, 0], turn[:, :, 1]
    shoulder, elbow, wrist = (frames.position_mm[:, place] for place in (1, 2, 4))
    arm = np.cross(elbow - shoulder, wrist - elbow)
    ahead = np.sum(front * (wrist - frames.position_mm[:, 0]), axis=1) >= 0.0
    return np.stack([ahead, np.sum(arm * left, axis=1) > 0.0, q_rad[:, 4] > 0.0], axis=1)


def changed(robot: Robot, posture: Named, stated: tuple, q_rad: np.ndarray) -> str:
    """The parts of the posture at joints (k,) that are not as stated, in the controller's words."""
    now = posture(sides(robot, q_rad)[0], np.rad2deg(q_rad))
    apart = [part for part, wanted in zip(now, stated, strict=True) if wanted not in (None, part)]
    return ", ".join(apart)


def _has(posture: Named, stated: tuple, flags: np.ndarray, q_rad: np.ndarray) -> bool:
    """Whether joints (k,) with their sides are in a posture, but for rounding of the program."""
    near = []
    for slack_deg in (0.0, _STATED_DEG, -_STATED_DEG):
        moved = np.rad2deg(q_rad) + slack_deg
        near.append(posture((flags[0], flags[1], moved[4] > 0.0), moved))
    parts = zip(stated, *near, strict=True)
    return all(wanted is None or wanted in names for wanted, *names in parts)


def postures_of(robot: Robot, flange: Pose) -> list[np.ndarray]:
    """Reported joints (m, k) of every posture and turn within the limits, by flange pose (n, ...).

    Poses are in the robot's base frame.
    """
    goal = compose(invert(robot.base), compose(flange, invert(robot.flange)))
    found = solve(robot, robot.dh, goal).q_rad
    turns = 2.0 * np.pi * np.array([0, -1, 1, -2, 2])
    every = []
    for ways in found:
        reported = limits.reported_joints(robot, ways[np.isfinite(ways).all(axis=1)])
        several = []
        for q_rad in reported:
            columns = [
                [
                    v
                    for v in value + (0.0 if slides else turns) * np.ones(5)
                    if low - 1e-9 <= v <= high + 1e-9
                ]
                for value, slides, low, high in zip(
                    q_rad, robot.dh.prismatic, robot.q_min_rad, robot.q_max_rad, strict=True
                )
            ]
            several += list(product(*map(dict.fromkeys, columns)))
        every.append(np.array(several).reshape(-1, robot.dh.joints))
    return every


def choose(
    robot: Robot,
    ways: np.ndarray,
    posture: Named | None,
    stated: tuple[str | None, ...] | None,
    near_rad: np.ndarray | None,
) -> np.ndarray:
    """Of joints ``ways`` (m, k) those in the stated posture, nearest to ``near_rad``.

    Raises InputError where there are none, or several and nothing to choose by.
    """
    if len(ways) == 0:
        raise InputError(Problem("position", "the nominal arm cannot reach it within its limits"))
    if stated is not None and posture is not None:
        flags = sides(robot, ways)
        fits = [_has(posture, stated, *each) for each in zip(flags, ways, strict=True)]
        if not any(fits):
            words = ", ".join(filter(None, stated))
            what = f"the nominal arm cannot reach it in the posture {words}"
            raise InputError(Problem("position", what))
        ways = ways[fits]
    if near_rad is None:
        if len(ways) > 1 and stated is None:
            fix = "give joints to start from: --near-deg"
            raise InputError(Problem("position", "no posture is stated", fix=fix))
        near_rad = np.zeros(ways.shape[1])
    return ways[np.argmin(np.max(np.abs(ways - near_rad), axis=1).round(9))]
