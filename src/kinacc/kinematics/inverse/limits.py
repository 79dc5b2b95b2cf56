"""Which turn of a joint is taken, and which joints an arm can reach."""

from __future__ import annotations

import numpy as np

from kinacc.kinematics.robot import Robot

_TWO_PI = 2.0 * np.pi
_ROUND_OFF_RAD = 1e-12
_TIE_RAD = 1e-9
_OUTSIDE = 100.0  # more than any angle in rad that is compared


def reported_joints(robot: Robot, q_rad: np.ndarray) -> np.ndarray:
    """Joints (..., k) as the controller reports them, of DH joint angles (..., k)."""
    if np.array_equal(robot.joint_map, np.eye(len(robot.joint_map))):
        return q_rad
    return q_rad @ np.linalg.inv(robot.joint_map).T


def travel_unit(robot: Robot) -> np.ndarray:
    """Movement (k,) of each joint that counts as a radian: one, or a metre where it slides."""
    return np.where(robot.dh.prismatic, 1000.0, 1.0)


def dh_limits(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Limits (k,), (k,) of the DH joints; infinite where a joint is coupled to others."""
    joints = len(robot.joint_map)
    lower, upper = np.full(joints, -np.inf), np.full(joints, np.inf)
    for joint in np.flatnonzero(uncoupled(robot)):
        sign = robot.joint_map[joint, joint]
        ends = sign * robot.q_min_rad[joint], sign * robot.q_max_rad[joint]
        lower[joint], upper[joint] = min(ends), max(ends)
    return lower, upper


def cut_to_range(
    robot: Robot,
    low: np.ndarray,
    high: np.ndarray,
    range_rad: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """A box of reported joints (k,), (k,) cut to a range of DH joints where these are uncoupled."""
    low, high = low.copy(), high.copy()
    for joint in np.flatnonzero(uncoupled(robot)):
        ends = [end[joint] / robot.joint_map[joint, joint] for end in range_rad]
        low[joint], high[joint] = max(low[joint], min(ends)), min(high[joint], max(ends))
    return low, high


def uncoupled(robot: Robot) -> np.ndarray:
    """Whether a reported joint (k,) turns its own DH joint and no other, and is alone in that."""
    present = robot.joint_map != 0.0
    own = np.diagonal(present)
    return own & (present.sum(axis=0) == 1) & (present.sum(axis=1) == 1)


def within_limits(robot: Robot, q_rad: np.ndarray) -> np.ndarray:
    """Whether DH joint angles (..., k) respect the limits of the reported joints, (...)."""
    return within(reported_joints(robot, q_rad), robot.q_min_rad, robot.q_max_rad)


def within(q_rad: np.ndarray, lower_rad: np.ndarray, upper_rad: np.ndarray) -> np.ndarray:
    """Whether joints (..., k) lie in the box (k,), (k,), its faces included; (...)."""
    inside = (q_rad >= lower_rad - _ROUND_OFF_RAD) & (q_rad <= upper_rad + _ROUND_OFF_RAD)
    return inside.all(axis=-1)


def take_coupled_turns(robot: Robot, q_rad: np.ndarray) -> np.ndarray:
    """DH joints (..., k) moved by whole turns of reported, coupled joints that are then allowed."""
    whole, coupled = np.rint(robot.joint_map), ~uncoupled(robot)
    if not coupled.any() or not np.array_equal(whole, robot.joint_map):
        return q_rad
    reported = reported_joints(robot, q_rad)
    low, high = robot.q_min_rad - _ROUND_OFF_RAD, robot.q_max_rad + _ROUND_OFF_RAD
    up = np.ceil(np.maximum(low - reported, 0.0) / _TWO_PI)
    down = np.ceil(np.maximum(reported - high, 0.0) / _TWO_PI)
    moved = reported + _TWO_PI * (up - down)
    fits = coupled & (moved >= low) & (moved <= high)
    return q_rad + _TWO_PI * (np.where(fits, up - down, 0.0) @ whole.T)


def take_turns(
    q_rad: np.ndarray,
    limits_rad: tuple[np.ndarray, np.ndarray],
    preferred_rad: tuple[np.ndarray, np.ndarray] | None = None,
    prismatic: np.ndarray | None = None,
) -> np.ndarray:
    """Joints (..., k) moved by whole turns: inside the limits, inside the preferred box, near zero.

    Of all turns within ``limits_rad`` the one within ``preferred_rad`` (the range a model was
    fitted over: a Chebyshev error differs between q and q + 2 pi) that is nearest to zero is
    taken; where none lies within both, the one within the limits nearest to zero; where none does,
    the one in (-pi, pi]. Joints that slide (``prismatic`` (k,)) are left alone.
    """
    # Half a turn is a tie that round-off must not decide: it counts as +pi.
    base = q_rad - _TWO_PI * np.rint(q_rad / _TWO_PI)
    base = np.where(base < -np.pi + _TIE_RAD, base + _TWO_PI, base)
    best, lowest = base, np.full(base.shape, np.inf)
    for turns in (0, -1, 1, -2, 2):  # these reach every turn a +-720 degree joint has
        angle = base + turns * _TWO_PI
        cost = np.abs(angle)
        for weight, box in ((2.0 * _OUTSIDE, limits_rad), (_OUTSIDE, preferred_rad)):
            if box is not None:
                lower, upper = box
                outside = (angle < lower - _ROUND_OFF_RAD) | (angle > upper + _ROUND_OFF_RAD)
                cost += weight * outside
        better = cost < lowest
        best, lowest = np.where(better, angle, best), np.where(better, cost, lowest)
        if (lowest < _OUTSIDE).all():
            break
    return best if prismatic is None else np.where(prismatic, q_rad, best)
